"""What feeds a loopback camera dies, so that the reader waits without an error: stalled, blind; then it is fed again."""
import robot


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.loopback()
    feeds = [(left, robot.FRAMES / "left"), (right, robot.FRAMES / "right")]
    radio = robot.Radio(stack)
    # No writer yet: such a device is no camera, and the daemon waits for it.
    daemon = robot.Daemon(stack, **robot.camera_settings(left, right))
    radio.wait(lambda health: health.state == robot.health_t.STATE_STARTING, "state starting")
    for _ in range(2):
        feeder = robot.feed(stack, *feeds, options=["--loop"])
        radio.wait_running()
        feeder.kill()
        radio.wait_blind()
        robot.expect_no_masks(radio)
        radio.wait(lambda health: robot.counters(health)["camera_restarts"] > 0, "the cameras closed and opened again")
    robot.feed(stack, *feeds, options=["--loop"])
    radio.wait_running()
    daemon.end()
    return robot.told(radio.now())


robot.run(case)
