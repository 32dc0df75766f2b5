"""Both nodes vanish (driver unbound) and return, a dozen times: blind, then running again, and nothing grows."""
import pathlib
import time

import robot

DRIVER = pathlib.Path("/sys/bus/platform/drivers/vivid")
WARM_UP = 2  # whatever is made once has been made
TIMES = 10


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.vivid()
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **robot.vivid_settings(left, right))
    radio.wait_running()
    used = []
    slowest_s = 0.0
    for _ in range(WARM_UP + TIMES):
        (DRIVER / "unbind").write_text("vivid.0")
        robot.expect(not pathlib.Path(left).exists(), f"{left} is still there")
        radio.wait_blind()
        robot.expect_no_masks(radio)
        (DRIVER / "bind").write_text("vivid.0")
        returned = time.monotonic()
        radio.wait_running(pairs=1)
        slowest_s = max(slowest_s, time.monotonic() - returned)
        radio.wait_running()
        used.append(daemon.resources())
    used = used[WARM_UP - 1:]
    threads, descriptors, taken_kb = (sorted({each[i] for each in used}) for i in range(3))
    robot.expect(len(threads) == 1, f"threads: {threads}")
    robot.expect(len(descriptors) == 1, f"descriptors: {descriptors}")
    robot.expect(len(taken_kb) == 1, f"kB of memory taken: {taken_kb}")
    # A path gone for the first time touches a page for the first time; a leak does so again and again.
    touched_kb = [each[3] for each in used]
    halves_kb = [touched_kb[TIMES // 2] - touched_kb[0], touched_kb[-1] - touched_kb[TIMES // 2]]
    robot.expect(min(halves_kb) <= 0, f"memory grows in both halves of {TIMES} replugs, by kB: {halves_kb}")
    daemon.end()
    return (f"{WARM_UP + TIMES} times, masks again after {slowest_s:.1f} s at most (emulated); {threads[0]} threads, "
            f"{descriptors[0]} descriptors, {touched_kb[-1] - touched_kb[0]:+d} kB in the last {TIMES}")


robot.run(case)
