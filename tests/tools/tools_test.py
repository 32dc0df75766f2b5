#!/usr/bin/env python3
"""Tests of the scripts beside this one, run as a user runs them."""
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zipfile
import zlib

TOOLS = pathlib.Path(__file__).resolve().parent


def run(tool, *arguments):
    return subprocess.run([sys.executable, TOOLS / tool, *map(str, arguments)], capture_output=True, text=True,
                          check=False)


def npy(values, shape, kind="<f4"):
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + struct.pack(f"<{len(values)}f", *values)


class Npz(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.npz = pathlib.Path(self.folder.name) / "truth.npz"
        self.png = pathlib.Path(self.folder.name) / "disp.png"

    def write(self, data):
        with zipfile.ZipFile(self.npz, "w") as archive:
            archive.writestr("arr_0.npy", data)

    def test_values(self):
        nan, inf = float("nan"), float("inf")
        self.write(npy([0.5, inf, nan, -1.0, 0.0, 300.0, 1 / 1024, 2.001953125], (2, 4)))
        self.assertEqual(run("npz_to_disparity_png.py", self.npz, self.png).returncode, 0)
        data = self.png.read_bytes()
        self.assertEqual(struct.unpack(">IIBB", data[16:26]), (4, 2, 16, 0))
        at = data.index(b"IDAT")
        length = struct.unpack(">I", data[at - 4:at])[0]
        rows = zlib.decompress(data[at + 4:at + 4 + length])
        self.assertEqual(struct.unpack(">x4Hx4H", rows), (128, 0, 0, 0, 0, 65535, 1, 513))

    def test_refusals(self):
        for data in (b"", b"\x93NUMPY\x01\x00", npy([1.0], (1, 1), "<f8"), npy([1.0], (1,)), npy([1.0], (2, 2))):
            self.write(data)
            done = run("npz_to_disparity_png.py", self.npz, self.png)
            self.assertEqual(done.returncode, 66, done.stderr)
            self.assertIn("truth.npz: ", done.stderr)
            self.assertNotIn("Traceback", done.stderr)
            self.assertFalse(self.png.exists())


class Deploy(unittest.TestCase):
    """packaging/deploy.sh, with a host that is a folder of programs which only say what they were called with."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.host = pathlib.Path(self.folder.name) / "host"
        self.host.mkdir()
        self.called = pathlib.Path(self.folder.name) / "called"
        self.called.touch()
        # What looks like a package's name in the folder's is left alone.
        self.packages = pathlib.Path(self.folder.name) / "groundline_packages"
        self.packages.mkdir()
        for name in ("groundline", "groundline-libcamera"):
            (self.packages / f"{name}_0.1.0-1_robotic.deb").write_text(name)
        self.program("ssh", 'shift; PATH="%s:$PATH" exec sh -c "$*"' % self.host)
        self.program("id", "echo 0")
        self.program("dpkg", "echo robotic")
        self.program("dpkg-query", "exit 1")
        self.program("apt-get", 'echo * >>"%s"' % self.called)
        self.program("journalctl", "echo journal")

    def program(self, name, lines):
        (self.host / name).write_text(f"#!/bin/sh\n{lines}\n")
        (self.host / name).chmod(0o755)

    def deploy(self, enabled=True, active=(), failing="none", status=78):
        running = "\\n".join(f"{unit} loaded active running it runs" for unit in active)
        self.program("systemctl", f"""case "$*" in
    "-q is-enabled"*) exit {0 if enabled else 1} ;;
    list-units*) printf "{running}" ;;
    "restart {failing}") exit 1 ;;
    restart*) echo "$*" >>"{self.called}" ;;
    show*) echo {status} ;;
esac""")
        self.called.write_text("")
        done = subprocess.run([TOOLS / "../../packaging/deploy.sh", "robot"], capture_output=True, text=True, check=False,
                              stdin=subprocess.DEVNULL,
                              env={**os.environ, "GROUNDLINE_SSH": str(self.host / "ssh"),
                                   "GROUNDLINE_PACKAGES": str(self.packages)})
        return done.returncode, done.stdout + done.stderr, self.called.read_text().splitlines()

    def test_what_is_restarted(self):
        for enabled, active, restarted in (
                (True, (), ["restart groundlined.service"]),
                (True, ("groundlined.service",), ["restart groundlined.service"]),
                (False, ("groundlined.service",), ["restart groundlined.service"]),
                (False, ("groundlined@front.service", "groundlined@rear.service"),
                 ["restart groundlined@front.service", "restart groundlined@rear.service"]),
                (False, (), [])):
            status, said, (_, *called) = self.deploy(enabled, active)
            self.assertEqual((status, called), (0, restarted), said)

    def test_a_rig_that_does_not_come_up(self):
        status, said, _ = self.deploy(False, ("groundlined@front.service",), "groundlined@front.service")
        self.assertEqual(status, 1)
        self.assertIn("groundlined --config /etc/groundline/front.yaml --check-config", said)

    def test_the_driver_goes_with_it_where_it_is_installed(self):
        for installed, sent in (("exit 1", 1), ("printf installed", 2)):
            self.program("dpkg-query", installed)
            status, said, (debs, *_) = self.deploy()
            self.assertEqual((status, len(debs.split()) - 1), (0, sent), said)  # and the script

    def test_no_debian(self):
        self.program("dpkg", "exit 127")
        status, said, called = self.deploy()
        self.assertEqual((status, called), (1, []))
        self.assertIn("is no Debian", said)

    def test_nothing_stays_there(self):
        self.program("mktemp", f'mkdir "{self.folder.name}/there" && echo "{self.folder.name}/there"')
        for receive in ('exec /bin/tar "$@"', 'cat >/dev/null; exit 1'):
            self.program("tar", receive)
            status, said, called = self.deploy()
            self.assertEqual((status, bool(called)), (0, True) if "exec" in receive else (1, False), said)
            self.assertFalse(pathlib.Path(self.folder.name, "there").exists())


class Summary(unittest.TestCase):
    def test_skips_are_grouped_by_reason(self):
        block = "{0}/3 Testing: t{0}\nOutput:\n{1}<end of output>\n{2}\n"
        skipped = "/x.cpp:3: Skipped\n{0}\n[  SKIPPED ] A\n"
        note = "Test Pass Reason:\nSkip regular expression found in output."
        with tempfile.NamedTemporaryFile("w", suffix=".log") as log:
            log.write(block.format(1, "fine\n", "Test Passed.") + block.format(2, skipped.format("no data"), note)
                      + block.format(3, skipped.format("no data"), note))
            log.flush()
            said = run("test_summary.py", log.name).stdout
        self.assertEqual(said, "3 tests, 2 of them skipped:\n     2 no data\n")


if __name__ == "__main__":
    unittest.main()
