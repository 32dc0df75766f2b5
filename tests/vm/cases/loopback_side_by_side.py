"""One loopback camera with both eyes side by side in YUYV: the masks are those of the files."""
import delivered
import robot


def case(stack):
    robot.need_driver("v4l2")
    (device,) = robot.loopback(1)
    settings = robot.camera_settings("", "", capture_device=device)
    return delivered.judge(stack, settings, {"capture_format": "yuyv"}, robot.FRAMES, "YUYV",
                           [(device, f"{robot.FRAMES}/left+{robot.FRAMES}/right")], least=30)


robot.run(case)
