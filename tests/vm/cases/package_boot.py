"""The service starts with the machine, without a network and before its cameras; these come 20 s later, under names of a
udev rule, and a listener that did nothing for it hears masks. Then the package is upgraded, which keeps the edited
configuration, removed, and purged."""
import pathlib
import time

import robot
import service

RULES = pathlib.Path("/etc/udev/rules.d/70-groundline-cameras.rules")
NAMES = "".join(f'SUBSYSTEM=="video4linux", ATTR{{index}}=="0", ATTR{{name}}=="Cam{side}", SYMLINK+="stereo-{eye}"\n'
                for side, eye in (("L", "left"), ("R", "right")))
LATE_S = 20


def uptime_s():
    return float(pathlib.Path("/proc/uptime").read_text().split()[0])


def install():
    service.install()
    RULES.write_text(NAMES)
    service.configure(robot.camera_settings("/dev/stereo-left", "/dev/stereo-right"))


def cameras_come(stack):
    robot.expect("default" not in robot.command("ip", "route"), "there is a network")
    robot.expect(service.routes() == [service.ROUTE], f"routes: {service.routes()}")
    robot.until(service.active, lambda: f"the service at boot; {service.said()[-300:]}")
    service.step("the service runs")
    time.sleep(max(0.0, LATE_S - uptime_s()))
    robot.command("modprobe", "v4l2loopback", "devices=2", "video_nr=10,11", "card_label=CamL,CamR", "max_buffers=4",
                  "exclusive_caps=1,1")
    radio = robot.Radio(stack, prepare=False)
    radio.wait(lambda health: health.state == robot.health_t.STATE_STARTING, "state starting")
    service.step("it waits for cameras")
    feeder = robot.feed(stack, ("/dev/video10", robot.FRAMES / "left"), ("/dev/video11", robot.FRAMES / "right"), rate=2,
                        options=["--loop"])
    radio.wait_running()
    robot.expect(service.show("NRestarts") == "0", "it had to be restarted")
    feeder.kill()  # frames go before everything else on this machine, so the rest would take minutes
    return radio


def case(stack):
    if not service.CONFIG.exists():
        install()
        service.start_anew()
    radio = cameras_come(stack)
    service.step("masks are heard")
    edited = service.CONFIG.read_text()
    process = service.show("MainPID")

    service.install("next")
    robot.expect("-99" in robot.command("dpkg-query", "-W", "groundline"), "the next version is not there")
    robot.expect(service.CONFIG.read_text() == edited, "the upgrade changed the edited configuration")
    robot.until(lambda: service.active() and service.show("MainPID") != process, "the restart by the upgrade")
    radio.wait(lambda health: health.state == robot.health_t.STATE_STARTING, "state starting")

    service.step("upgraded")
    robot.command("dpkg", "--remove", "groundline-libcamera", "groundline")
    robot.expect(not service.active(), "it runs after its removal")
    robot.expect(not service.routes(), f"routes after the removal: {service.routes()}")
    robot.expect(service.CONFIG.read_text() == edited, "the removal changed the configuration")
    service.step("removed")
    service.install("next")
    robot.expect(robot.command("systemctl", "is-enabled", service.UNIT).strip() == "enabled", "not enabled again")
    robot.command("systemctl", "enable", "groundlined@front.service")
    robot.command("dpkg", "--purge", "groundline-libcamera", "groundline")
    RULES.unlink()
    service.be_impatient()
    left = [path for folder in ("/etc", "/usr", "/var/lib/systemd") for path in pathlib.Path(folder).rglob("*groundline*")]
    robot.expect(not left, f"left after the purge: {', '.join(map(str, left))}")
    return f"{len(radio.masks)} masks were heard"


robot.run(case)
