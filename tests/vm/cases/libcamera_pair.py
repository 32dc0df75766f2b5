"""Two vimc cameras through libcamera, in one process: pairs come, are processed and published.

They run free, each as fast as the machine can, and take no rate: it is set so low that half its period allows what
they are apart.
"""
import robot


def case(stack):
    robot.need_driver("libcamera")
    robot.command("modprobe", "vimc")
    robot.command("modprobe", "vimc_twin")
    robot.command("udevadm", "settle")
    radio = robot.Radio(stack)
    settings = robot.camera_settings("platform/vimc.0 Sensor B", "platform/vimc.1 Sensor B", capture_driver="libcamera",
                                     capture_width=318,  # vimc scales to multiples of 6
                                     capture_pair__tolerance__ms=1000, capture_rate__hz=0.4,
                                     capture_stall__timeout__s=10)
    daemon = robot.Daemon(stack, **settings)
    health = radio.wait_running(pairs=5)
    robot.expect(robot.counters(health)["frames_bad"] == 0, robot.told(health))
    daemon.end()
    return robot.told(radio.now())


robot.run(case)
