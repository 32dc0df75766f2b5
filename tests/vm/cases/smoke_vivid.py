"""The machine itself: both vivid cameras stream at one time."""
import robot


def stream(stack, device, form):
    robot.command("v4l2-ctl", "-d", device, f"--set-fmt-video=width=320,height=180,pixelformat={form}", "--set-parm=10")
    return robot.Program(stack, device.rsplit("/", 1)[1], "v4l2-ctl", "-d", device, "--stream-mmap=4", "--stream-count=20",
                         "--verbose")


def case(stack):
    left, right = robot.vivid()
    streams = [(stream(stack, left, "GREY"), 320 * 180), (stream(stack, right, "YUYV"), 2 * 320 * 180)]
    for program, size in streams:
        robot.until(lambda one=program: not one.running(), "20 pictures")
        pictures = [line for line in program.said().splitlines() if "dqbuf" in line]
        robot.expect(len(pictures) == 20, f"{len(pictures)} pictures of 20: {program.said()[-200:]}")
        robot.expect(all(f"bytesused: {size}" in line for line in pictures), f"not {size} bytes: {pictures[0]}")
    return "20 pictures of each camera"


robot.run(case)
