"""The packages and their service, for the cases that begin with package_."""
import os
import pathlib
import shutil
import subprocess
import sys
import time

import robot

CONFIG = pathlib.Path("/etc/groundline/groundline.yaml")
UNIT = "groundlined.service"
ROUTE = "239.255.76.67 dev lo proto 76 scope link"
SCHED_FIFO = 1
SCHED_RESET_ON_FORK = 0x40000000


def step(what):
    """For the case's log: how far it came."""
    print(f"{time.monotonic():.0f} s: {what}", flush=True)


def be_patient():
    """The watchdog's 5 s are for a robot: emulated on a busy computer all is ten times slower and more."""
    for unit in (UNIT, "groundlined@.service", "groundline-replay@.service"):
        folder = pathlib.Path(f"/etc/systemd/system/{unit}.d")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "emulated.conf").write_text("[Service]\nWatchdogSec=20s\n")


def be_impatient():
    for file in pathlib.Path("/etc/systemd/system").glob("*.d/emulated.conf"):
        shutil.rmtree(file.parent)


def install(which="this"):
    """The daemon and the libcamera driver with dpkg alone, so that what they depend on must be there."""
    be_patient()
    debs = [str(deb) for name in ("groundline_", "groundline-libcamera_")
            for deb in pathlib.Path(f"/w/debs/{which}").glob(f"{name}*.deb")]
    robot.expect(len(debs) == 2, f"packages: {debs}")
    return robot.command("dpkg", "--force-confold", "-i", *debs)


def configure(settings, file=CONFIG):
    """A configuration file of these keys, written as robot.Daemon takes them; one key a line from the second on."""
    lines = [f"{key.replace('__', ' ').replace('_', '.').replace(' ', '_')}: {value}" for key, value in settings.items()]
    file.write_text("\n".join(["# of the case", *lines, ""]))


def show(what, unit=UNIT):
    return robot.command("systemctl", "show", "-P", what, unit).strip()


def active(unit=UNIT):
    return show("ActiveState", unit) == "active"


def start(verb="start"):
    done = subprocess.run(["systemctl", verb, UNIT], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          check=False)
    return done.returncode == 0


def said():
    """What the service wrote to the journal since the machine started."""
    robot.command("journalctl", "--sync")
    return robot.command("journalctl", "-b", "-o", "cat", "-u", UNIT)


def routes():
    return [line.strip() for line in robot.command("ip", "route").splitlines() if "dev lo" in line]


def expect_route():
    """That it is there when systemd has done all that it was to do."""
    robot.until(lambda: "No jobs" in robot.command("systemctl", "list-jobs"), "the end of systemd's jobs")
    robot.expect(ROUTE in routes(), f"routes: {routes()}")


def real_time_threads(process):
    return [thread for thread in os.listdir(f"/proc/{process}/task")
            if os.sched_getscheduler(int(thread)) & ~SCHED_RESET_ON_FORK == SCHED_FIFO]


def status(process):
    return dict(line.split(":\t", 1) for line in pathlib.Path(f"/proc/{process}/status").read_text().splitlines())


def start_anew():
    """The machine boots; the case runs once more, then with whatever it left on the disk."""
    print("robot: again", flush=True)
    subprocess.run(["systemctl", "reboot", "--force"], check=False)
    time.sleep(robot.PATIENCE_S)
    sys.exit("the machine did not start anew")
