"""The virtual robot as a machine: starts the image that image.sh made, runs one command in it, ends it.

Emulated throughout (no hardware virtualisation is asked for). The first start boots and saves the machine's state
beside the image; every run goes on from there, on a disk that forgets what was written.
"""
import contextlib
import hashlib
import json
import os
import pathlib
import shutil
import socket
import subprocess
import tempfile
import time

BOOT_LIMIT_S = 600  # 12 s on an idle machine


class Broken(Exception):
    """The machine did not come up or died: no answer of the command's."""


class Machine:
    def __init__(self, image):
        self.image = pathlib.Path(image).resolve()
        settings = ["-machine", "q35,vmport=off,smm=off,hpet=off", "-accel", "tcg,thread=multi", "-cpu", "Nehalem",
                    "-smp", "2", "-m", "1024", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot",
                    "-device", "virtio-rng-pci", "-device", "virtio-serial-pci",
                    "-kernel", str(self.image / "vmlinux"), "-initrd", str(self.image / "initrd.cpio"),
                    "-append", "console=ttyS0 root=/dev/vda rw quiet panic=-1 mitigations=off audit=0"]
        self.settings = settings
        # The state fits a machine of just these devices, in this qemu.
        devices = self._command("", "", "", "", "")
        version = subprocess.run(["qemu-system-x86_64", "--version"], capture_output=True, text=True, check=True)
        state = hashlib.sha256("\n".join(devices + [version.stdout]).encode()).hexdigest()[:12]
        self.state = self.image / f"state-{state}"
        self.disk = self.image / f"state-{state}.qcow2"

    def _command(self, folder, disk, shared, out, network):
        return ["qemu-system-x86_64", *self.settings,
                "-drive", f"{disk},if=virtio,cache=unsafe",
                "-serial", f"file:{folder}/console",
                "-qmp", f"unix:{folder}/qmp,server=on,wait=off",
                "-chardev", f"socket,id=port,path={folder}/port,server=on,wait=off",
                "-device", "virtserialport,chardev=port,name=robot",
                # A network that reaches nothing; nor does the machine know of it until a case sets it up.
                "-netdev", f"user,id=net,restrict=on{network}", "-device", "virtio-net-pci,netdev=net,romfile=",
                "-virtfs", f"local,path={shared},mount_tag=w,security_model=none,readonly=on,multidevs=remap",
                "-virtfs", f"local,path={out},mount_tag=out,security_model=none,multidevs=remap"]

    @contextlib.contextmanager
    def _started(self, folder, disk, shared, out, extra, network=""):
        """qemu with its sockets and console in `folder`; killed at the end."""
        command = [*self._command(folder, disk, shared, out, network), *extra]
        with open(f"{folder}/qemu", "w", encoding="utf-8") as said:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
        try:
            yield process
        finally:
            process.kill()
            process.wait()

    @staticmethod
    def _connected(path, process, limit):
        while process.poll() is None and time.monotonic() < limit:
            with contextlib.suppress(FileNotFoundError, ConnectionRefusedError):
                link = socket.socket(socket.AF_UNIX)
                link.connect(path)
                return link
            time.sleep(0.05)
        raise Broken("qemu opens no socket")

    @staticmethod
    def _why(folder):
        lines = []
        for name in ("qemu", "console"):
            with contextlib.suppress(OSError):
                lines += pathlib.Path(folder, name).read_text(errors="replace").splitlines()[-5:]
        return "; ".join(lines) or "it said nothing"

    def prepare(self):
        """Boots and saves the state unless that was done; seconds taken."""
        if self.state.exists():
            return 0.0
        begin = time.monotonic()
        limit = begin + BOOT_LIMIT_S
        part = self.image / "state.part"
        with tempfile.TemporaryDirectory(prefix="groundline-vm.") as folder:
            self.disk.unlink(missing_ok=True)
            subprocess.run(["qemu-img", "create", "-q", "-f", "qcow2", "-F", "raw", "-b",
                            str(self.image / "root.ext4"), str(self.disk)], check=True)
            with self._started(folder, f"file={self.disk},format=qcow2", folder, folder, []) as process:
                self._wait_ready(folder, process, limit)
                with self._connected(f"{folder}/qmp", process, limit) as link, link.makefile("rw") as qmp:
                    def ask(execute, **arguments):
                        qmp.write(json.dumps({"execute": execute, "arguments": arguments}) + "\n")
                        qmp.flush()
                        while True:
                            answer = json.loads(qmp.readline())
                            if "return" in answer or "error" in answer:
                                return answer.get("return")

                    ask("qmp_capabilities")
                    ask("migrate-set-parameters", **{"max-bandwidth": 1 << 40})
                    ask("migrate", uri=f"exec:cat > '{part}'")
                    while (status := ask("query-migrate").get("status")) not in ("completed", "failed"):
                        time.sleep(0.2)
                    if status == "failed":
                        raise Broken(f"its state cannot be saved: {self._why(folder)}")
        part.rename(self.state)
        return time.monotonic() - begin

    @staticmethod
    def _wait_ready(folder, process, limit):
        console = pathlib.Path(folder, "console")
        while "robot: ready" not in (console.read_text(errors="replace") if console.exists() else ""):
            if process.poll() is not None or time.monotonic() > limit:
                raise Broken(f"it does not start: {Machine._why(folder)}")
            time.sleep(0.2)

    def run(self, command, shared, out, limit_s, hear=lambda line: None, ssh_port=None):
        """Runs `command` in /w, which is `shared` (read-only), with `out` as /out; every line goes to hear().

        The line "robot: again" says that the machine starts anew now; then `command` is run once more. `ssh_port` of
        this computer leads to the machine's, once it has set its network up (10.0.2.15).
        Exit status, or None where limit_s ran out. Raises Broken.
        """
        shutil.rmtree(out, ignore_errors=True)
        os.makedirs(out)
        limit = time.monotonic() + limit_s
        with tempfile.TemporaryDirectory(prefix="groundline-vm.") as folder:
            disk = f"file={self.disk},format=qcow2,snapshot=on"
            state = ["-incoming", f"exec:cat '{self.state}'", "-action", "reboot=reset"]
            network = f",hostfwd=tcp:127.0.0.1:{ssh_port}-10.0.2.15:22" if ssh_port else ""
            with self._started(folder, disk, shared, out, state, network) as process, \
                    self._connected(f"{folder}/port", process, limit) as link:
                def start():
                    try:
                        link.sendall(f"{time.time():.3f} {command}\n".encode())
                    except OSError as error:
                        raise Broken(f"it died: {self._why(folder)}") from error

                start()
                rest = b""
                while (left_s := limit - time.monotonic()) > 0:
                    link.settimeout(left_s)
                    try:
                        got = link.recv(1 << 16)
                    except TimeoutError:
                        return None
                    except OSError:  # its end, where something sent was not read
                        got = b""
                    if not got:
                        raise Broken(f"it died: {self._why(folder)}")
                    *lines, rest = (rest + got).split(b"\n")
                    for line in lines:
                        text = line.decode(errors="replace").rstrip("\r")
                        if text.startswith("robot: exit "):
                            return int(text.split()[-1])
                        if text == "robot: again":
                            self._wait_ready(folder, process, limit)
                            start()
                        hear(text)
                return None
