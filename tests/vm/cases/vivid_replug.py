"""Ten times both nodes vanish (driver unbound) and return: blind, then running again, and nothing grows."""
import pathlib
import time

import robot

DRIVER = pathlib.Path("/sys/bus/platform/drivers/vivid")
TIMES = 10


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.vivid()
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **robot.vivid_settings(left, right))
    radio.wait_running()
    used = []
    slowest_s = 0.0
    for number in range(TIMES):
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
    # Whatever is made once has been made after the second. Pages of memory taken long before may be touched for the
    # first time at any moment, by a path not gone before; but a leak would add some each time.
    threads, descriptors, taken_kb = (sorted({each[i] for each in used[1:]}) for i in range(3))
    robot.expect(len(threads) == 1, f"threads: {threads}")
    robot.expect(len(descriptors) == 1, f"descriptors: {descriptors}")
    robot.expect(len(taken_kb) == 1, f"kB of memory taken: {taken_kb}")
    resident_kb = [each[3] for each in used]
    steps_kb = sorted(after - before for before, after in zip(resident_kb, resident_kb[1:]))
    robot.expect(steps_kb[len(steps_kb) // 2] <= 0, f"resident memory grows with most replugs, by kB: {steps_kb}")
    daemon.end()
    return (f"{TIMES} times, masks again after {slowest_s:.1f} s at most (emulated); {threads[0]} threads, "
            f"{descriptors[0]} descriptors, resident {resident_kb[-1] - resident_kb[1]:+d} kB since the second")


robot.run(case)
