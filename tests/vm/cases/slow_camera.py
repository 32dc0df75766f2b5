"""One camera at a third of the other's rate: the pictures that pair are used, the others counted. One camera out of
step: no pairs, no masks, and the reason is said."""
import robot


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.loopback()
    feeds = [(left, robot.FRAMES / "left"), (right, robot.FRAMES / "right")]
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **robot.camera_settings(left, right))
    slow = robot.feed(stack, *feeds, rate=6, options=["--loop", "--every", "3"])
    radio.wait_running(pairs=5)
    health = radio.wait(lambda h: robot.counters(h)["camera_singles"] >= 10, "10 pictures without a partner")
    robot.expect(abs(health.pair_skew_ms) < 10, f"a pair {health.pair_skew_ms} ms apart")
    slow.kill()
    radio.wait_blind()
    off = robot.feed(stack, *feeds, rate=6, options=["--loop", "--late-ms", "-60"])
    robot.until(lambda: "out of step" in daemon.said(), "the log's word that the cameras are out of step")
    radio.wait(lambda h: h.reasons & robot.mask_t.REASON_UNSYNCHRONISED and h.verdict == robot.mask_t.VERDICT_BLIND,
               "blind because unsynchronised")
    robot.expect_no_masks(radio)
    off.kill()
    robot.feed(stack, *feeds, options=["--loop"])
    radio.wait_running()
    daemon.end()
    return robot.told(radio.now())


robot.run(case)
