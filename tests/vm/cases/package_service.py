"""The packages on a machine that has what they depend on: the service runs confined, in real time and with locked
memory; refuses a wrong configuration once, naming the line; reads it again; is restarted when it hangs; bears a wall
clock that jumps and a full disk. The route of its messages is there as long as it, a replay or a rig runs."""
import errno
import os
import pathlib
import signal
import time

import robot
import service

HOUR_US = 3_600_000_000


def refused(text, words):
    """This configuration: one start, no second, and the reason said."""
    service.CONFIG.write_text(text)
    robot.expect(not service.start(), f"a start with {text!r}")
    time.sleep(3)  # RestartSec is 1 s
    shown = [service.show(what) for what in ("ActiveState", "ExecMainStatus", "NRestarts")]
    robot.expect(shown == ["failed", "78", "0"], f"a refused configuration ends as {shown}")
    robot.expect(words in service.said(), f"the journal does not say {words!r}: {service.said()[-300:]}")


def fill_disk():
    """Leaves no block of the root file system."""
    with open("/fill", "wb") as file:
        size, step = 0, 1 << 28
        while step >= 1 << 12:
            try:
                os.posix_fallocate(file.fileno(), size, step)
                size += step
            except OSError as error:
                robot.expect(error.errno == errno.ENOSPC, f"the disk cannot be filled: {error}")
                step >>= 1
    free = os.statvfs("/")
    robot.expect(free.f_bavail < 16, f"{free.f_bavail} blocks are free")


def case(stack):
    operators = pathlib.Path("/etc/sysctl.d/70-robot.conf")
    operators.write_text("net.core.rmem_max = 9000000\n")
    service.install()
    buffers = robot.command("sysctl", "-n", "net.core.rmem_max", "net.core.rmem_default").split()
    robot.expect(buffers == ["9000000", "4194304"], f"buffers of sockets: {buffers}")
    robot.expect(robot.command("systemctl", "is-enabled", service.UNIT).strip() == "enabled", "not enabled")
    robot.expect(not service.active(), "started before a camera was configured")
    refused("terrain.tolerance_m: 0.3\nterrain.tolerence_m: 0.3\n", f"{service.CONFIG}:2: unknown configuration key")
    refused("# no cameras\n", "capture.source is not set")

    service.step("refused twice")
    robot.command("mount", "-t", "tmpfs", "tmpfs", "/tmp")  # where the listener writes, when the disk is full
    left, right = robot.vivid()
    # Frames go before everything else on this machine, so let there be few.
    settings = {**robot.vivid_settings(left, right), "capture_rate__hz": 2, "capture_pair__tolerance__ms": 250}
    service.configure(settings)
    robot.expect(service.start(), f"no start: {service.said()[-300:]}")
    radio = robot.Radio(stack)
    radio.wait_running()
    service.expect_route()
    changes = robot.Program(stack, "routes", "ip", "monitor", "route")
    process = service.show("MainPID")
    threads = service.real_time_threads(process)
    robot.expect(len(threads) >= 3, f"real-time threads: {threads}; {service.said()[-300:]}")
    kept = service.status(process)
    robot.expect(int(kept["VmLck"].split()[0]) > 1000, f"locked: {kept['VmLck']}; {service.said()[-300:]}")
    robot.expect(int(kept["Uid"].split()[0]) > 0 and int(kept["CapEff"], 16) == 0 and kept["Seccomp"] == "2",
                 f"user {kept['Uid']}, capabilities {kept['CapEff']}, system calls {kept['Seccomp']}")

    service.step("confined and in real time")
    # Hangs.
    os.kill(int(process), signal.SIGSTOP)
    robot.until(lambda: service.show("NRestarts") == "1" and service.active(), "the watchdog's restart")
    robot.expect("Watchdog timeout" in service.said(), "not restarted by the watchdog")
    radio.wait_running()
    process = service.show("MainPID")

    service.step("restarted by the watchdog")
    # A configuration for the running service, then one with a fault.
    service.configure({**settings, "terrain_tolerance__m": 0.35})
    robot.command("systemctl", "reload", service.UNIT)
    robot.until(lambda: "taken over: terrain.tolerance_m" in service.said(), "the journal's word of the new tolerance")
    service.CONFIG.write_text("terrain.tolerance_m: none\n")
    robot.command("systemctl", "reload", service.UNIT)
    robot.until(lambda: f"refused, the old one stays in force: {service.CONFIG}:1" in service.said(),
                "the journal's word of the faulty line")
    service.configure(settings)
    radio.wait_running()

    service.step("configured anew")
    # The wall clock an hour ahead: masks carry it, nothing else heeds it.
    before = radio.wait_running()
    last = radio.masks[-1]
    robot.command("date", "-s", "+1 hour")
    after = radio.wait_running(pairs=5)
    robot.expect(radio.masks[-1].utime - last.utime > HOUR_US, "utime is not the wall clock's")
    robot.expect(radio.masks[-1].exposure_mono_ns - last.exposure_mono_ns < 120e9, "the monotonic stamp jumped too")
    changed = {name: (robot.counters(before)[name], value) for name, value in robot.counters(after).items()
               if name == "camera_restarts" and value != robot.counters(before)[name]}
    robot.expect(not changed, f"counted over the jump: {changed}")

    service.step("clock jumped")
    fill_disk()
    radio.wait_running()
    robot.expect(service.show("MainPID") == process and service.show("NRestarts") == "1",
                 "restarted by the reload, the clock or the full disk")
    robot.expect(service.start("restart"), f"no start on a full disk: {service.said()[-300:]}")
    radio.wait_running()
    pathlib.Path("/fill").unlink()

    service.step("disk was full")
    # A recording in the daemon's place.
    replay = f"groundline-replay@{robot.command('systemd-escape', '--path', str(robot.FRAMES)).strip()}.service"
    robot.command("systemctl", "start", replay)
    robot.expect(not service.active() and service.active(replay), "the replay does not take the daemon's place")
    ended, began = (int(service.show(what, unit)) for what, unit in (("InactiveEnterTimestampMonotonic", service.UNIT),
                                                                     ("ExecMainStartTimestampMonotonic", replay)))
    robot.expect(ended <= began, f"the replay began {ended - began} us before the daemon ended")
    service.expect_route()
    robot.expect(service.ROUTE not in changes.said(), f"changes of routes: {changes.said()}")
    radio.wait_running()
    size = (radio.masks[-1].width, radio.masks[-1].height)
    robot.expect(size == robot.SIZE, f"masks of {size}, not of the recording")
    service.step("replayed")
    robot.command("systemctl", "stop", replay)
    robot.until(lambda: service.ROUTE not in service.routes(), "the end of the route without any daemon")

    # One of several rigs, by a file of its own.
    service.configure({"capture_driver": "synthetic", "capture_source": "drive?width=160&height=120&focal=125",
                       "publish_prefix": "FRONT"}, service.CONFIG.with_name("front.yaml"))
    robot.command("systemctl", "start", "groundlined@front.service")
    robot.expect(service.active("groundlined@front.service"), "the rig's service does not run")
    robot.expect(service.start(), f"no start beside the rig: {service.said()[-300:]}")
    robot.command("systemctl", "stop", service.UNIT)
    service.expect_route()
    return f"{len(threads)} real-time threads, {kept['VmLck'].strip()} locked; {robot.told(radio.now())}"


robot.run(case)
