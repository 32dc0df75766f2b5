"""Ten times both nodes vanish (driver unbound) and return: blind, then running again, and nothing grows."""
import pathlib

import robot

DRIVER = pathlib.Path("/sys/bus/platform/drivers/vivid")
TIMES = 10


def case(stack):
    robot.need_driver("v4l2")
    left, right = robot.vivid()
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **robot.vivid_settings(left, right))
    radio.wait_running()
    before = []
    for number in range(TIMES):
        (DRIVER / "unbind").write_text("vivid.0")
        robot.expect(not pathlib.Path(left).exists(), f"{left} is still there")
        radio.wait_blind()
        robot.expect_no_masks(radio)
        (DRIVER / "bind").write_text("vivid.0")
        robot.command("udevadm", "settle")
        radio.wait_running()
        if number == 1:  # whatever is made once has been made
            before = daemon.resources()
    threads, descriptors, memory_kb = daemon.resources()
    robot.expect(threads == before[0], f"{threads} threads, before {before[0]}")
    robot.expect(descriptors == before[1], f"{descriptors} descriptors, before {before[1]}")
    robot.expect(memory_kb < before[2] + 1024, f"{memory_kb} kB resident, before {before[2]}")
    daemon.end()
    return f"{TIMES} times; {threads} threads, {descriptors} descriptors, {memory_kb - before[2]:+d} kB since the second"


robot.run(case)
