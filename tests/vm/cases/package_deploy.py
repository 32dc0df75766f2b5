"""`./dev deploy` from the computer outside: at first the configuration is missing and the way out is said; with one, and
the same version installed already, the service runs; where it is disabled and a rig runs, the rig's is restarted alone."""
import pathlib
import subprocess

import robot
import service


def deploy(number):
    """Status and what was said; run.py does it when it hears of it."""
    print("robot: deploy", flush=True)
    done = pathlib.Path(f"/out/deploy-{number}")
    robot.until(done.exists, "the deployment", 240)
    said, _, status = done.read_text().rpartition("\n")
    return int(status), said


def case(stack):
    print("robot: key", flush=True)
    robot.until(lambda: pathlib.Path("/out/key.pub").exists(), "the key")
    robot.command("modprobe", "virtio_net")
    robot.command("udevadm", "settle")
    (card,) = (path.name for path in pathlib.Path("/sys/class/net").iterdir() if path.name != "lo")
    robot.command("ip", "address", "add", "10.0.2.15/24", "dev", card)
    robot.command("ip", "link", "set", card, "up")
    pathlib.Path("/root/.ssh").mkdir(mode=0o700, exist_ok=True)
    pathlib.Path("/root/.ssh/authorized_keys").write_text(pathlib.Path("/out/key.pub").read_text())
    pathlib.Path("/run/sshd").mkdir(exist_ok=True)
    server = robot.Program(stack, "sshd", "/usr/sbin/sshd", "-D", "-e")
    robot.until(lambda: "listening" in server.said(), lambda: f"sshd: {server.said()}")

    service.be_patient()
    status, said = deploy(1)
    robot.expect(status == 1 and "capture.source is not set" in said and "refuses its configuration" in said,
                 f"status {status}: {said[-400:]}")
    service.configure({"capture_driver": "synthetic", "capture_source": "drive?width=320&height=240&focal=250"})
    status, said = deploy(2)
    robot.expect(status == 0 and "active (running)" in said, f"status {status}: {said[-400:]}")
    robot.expect(service.active(), f"not active: {service.said()[-300:]}")
    robot.expect("synthetic" in service.CONFIG.read_text(), "the configuration was changed")

    service.configure({"capture_driver": "synthetic", "capture_source": "drive?width=160&height=120&focal=125",
                       "publish_prefix": "FRONT"}, service.CONFIG.with_name("front.yaml"))
    robot.command("systemctl", "disable", "--now", service.UNIT)
    rig = "groundlined@front.service"
    robot.command("systemctl", "start", rig)
    process = service.show("MainPID", rig)
    status, told = deploy(3)
    robot.expect(status == 0 and rig in told and "active (running)" in told, f"status {status}: {told[-400:]}")
    robot.expect(not service.active() and service.active(rig) and service.show("MainPID", rig) != process,
                 f"{service.UNIT} {service.active()}, {rig} {service.active(rig)}")
    left = subprocess.run("ls -d /tmp/groundline-deploy.*", shell=True, capture_output=True, text=True, check=False).stdout
    robot.expect(not left, f"left over there: {left}")
    return said.splitlines()[0]


robot.run(case)
