"""Errors that vivid injects are counted by their kind, and what must be opened anew is: lost and damaged pictures,
refused buffers, a stream that dies, a start that fails."""
import robot


def inject(device, control, value=1):
    robot.command("v4l2-ctl", "-d", device, "-c", f"{control}={value}")


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.vivid()
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **robot.vivid_settings(left, right))

    def raised(counter, act):
        before = robot.counters(radio.wait_running())[counter]
        act()
        radio.wait(lambda health: robot.counters(health)[counter] > before, f"{counter} above {before}")
        radio.wait_running()

    raised("camera_gaps", lambda: inject(left, "percentage_of_dropped_buffers", 50))
    inject(left, "percentage_of_dropped_buffers", 0)
    raised("camera_damaged", lambda: inject(right, "inject_v4l2_buf_flag_error"))
    # At once and for what it is, not as a camera that is silent, which would do in the end as well.
    for control, why in (("inject_vidioc_qbuf_error", "does not take its buffer back"),
                         ("inject_fatal_streaming_error", "Input/output error")):
        raised("camera_restarts", lambda control=control: inject(left, control))
        robot.expect(why in daemon.said(), f"after {control} the log does not say: {why}")

    def start_fails():
        inject(right, "inject_vidioc_streamon_error")
        inject(right, "inject_fatal_streaming_error")

    raised("camera_restarts", start_fails)
    daemon.end()
    return robot.told(radio.now())


robot.run(case)
