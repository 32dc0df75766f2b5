"""JPEG through two loopback cameras: the masks are those of the same JPEG files."""
import delivered
import robot


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.loopback()
    jpeg = robot.FRAMES / "jpeg"
    cameras = robot.camera_settings(left, right, capture_pair__tolerance__ms=20, capture_rate__hz=20)
    return delivered.judge(stack, cameras, {"capture_format": "mjpeg"},
                           jpeg, "MJPG", [(left, jpeg / "left"), (right, jpeg / "right")], least=30)


robot.run(case)
