"""Rendered frames through two loopback cameras: at least 100 masks, each the one that files give."""
import delivered
import robot


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.loopback()
    cameras = robot.camera_settings(left, right, capture_pair__tolerance__ms=20, capture_rate__hz=20)
    return delivered.judge(stack, cameras, {"capture_format": "grey"},
                           robot.FRAMES, "GREY", [(left, robot.FRAMES / "left"), (right, robot.FRAMES / "right")])


robot.run(case)
