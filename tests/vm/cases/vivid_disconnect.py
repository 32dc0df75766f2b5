"""A camera is pulled out (its calls give ENODEV) and comes back: blind without masks in between, then running again."""
import robot


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.vivid()
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **robot.vivid_settings(left, right))
    for eye in (left, right):
        radio.wait_running()
        # vivid is back as soon as nobody holds it open, so somebody does.
        with open(eye, "rb"):
            robot.command("v4l2-ctl", "-d", eye, "-c", "disconnect=1")
            radio.wait_blind()
            robot.expect_no_masks(radio)
        radio.wait_running()
    daemon.end()
    return f"left and right came back; {robot.told(radio.now())}"


robot.run(case)
