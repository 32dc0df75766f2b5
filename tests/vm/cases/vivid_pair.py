"""Two vivid cameras, in GREY and in YUYV: pairs come, are processed and published; the log says what was opened."""
import robot


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.vivid()
    for form in ("grey", "yuyv"):
        with robot.contextlib.ExitStack() as inner:
            radio = robot.Radio(inner)
            daemon = robot.Daemon(inner, **robot.vivid_settings(left, right), capture_format=form)
            health = radio.wait_running(pairs=10)
            counted = robot.counters(health)
            robot.expect((radio.masks[-1].width, radio.masks[-1].height) == (320, 180), "masks of another size")
            robot.expect(counted["frames_read"] > 0 and counted["frames_bad"] == 0, robot.told(health))
            robot.expect(health.stamp_source == robot.mask_t.STAMP_END_OF_FRAME,
                         f"stamps say they are {health.stamp_source}, vivid's are of the end of the frame")
            robot.expect(form in daemon.said().lower(), f"the log does not name the format {form}")
            daemon.end()
    return "pairs of GREY and of YUYV"


robot.run(case)
