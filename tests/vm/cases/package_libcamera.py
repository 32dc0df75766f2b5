"""Under the unit's confinement libcamera finds and opens its cameras: media devices, sub-devices, udev."""
import robot
import service


def case(stack):
    robot.command("modprobe", "vimc")
    robot.command("modprobe", "vimc_twin")
    robot.command("udevadm", "settle")
    service.install()
    # vimc takes no rate and scales to multiples of 6; see libcamera_pair.
    service.configure(robot.camera_settings("platform/vimc.0 Sensor B", "platform/vimc.1 Sensor B",
                                            capture_driver="libcamera", capture_width=318, capture_rate__hz=0.4,
                                            capture_pair__tolerance__ms=1000, capture_stall__timeout__s=10))
    radio = robot.Radio(stack)
    robot.expect(service.start(), f"no start: {service.said()[-300:]}")
    radio.wait_running()
    return robot.told(radio.now())


robot.run(case)
