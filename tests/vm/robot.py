"""What the cases share: the daemon under test, a listener on LCM, camera drivers; used inside the virtual robot.

A case is a program that ends with run(function). It passes by returning, fails by Failed (or any exception) and is
skipped by Skip; the sentence goes to the last line. Emulation is slow and loses frames at random, so cases wait for
states and counters, at most PATIENCE_S, and never judge times or ask for no losses.
"""
import contextlib
import os
import pathlib
import signal
import struct
import subprocess
import sys
import time

sys.path.insert(0, "/w/messages")
from groundline.health_t import health_t  # noqa: E402
from groundline.image_t import image_t  # noqa: E402
from groundline.mask_t import mask_t  # noqa: E402

PATIENCE_S = 90
URL = "udpm://239.255.76.67:7667?ttl=0"
SKIPPED = 77
FIFO, ORDINARY = os.SCHED_FIFO, os.SCHED_OTHER
STATES = ("starting", "running", "stalled", "stopping")
VERDICTS = ("blind", "degraded", "trusted")
FRAMES = pathlib.Path("/w/frames")  # left/, right/, jpeg/, calib.txt: what frames.cpp rendered
SIZE = (320, 240)
NUMBER_MASK = "0,0 136,0 136,24 0,24"  # hides the frame's number


class Failed(Exception):
    pass


class Skip(Exception):
    pass


def run(case):
    """Ends the program as the machine outside expects."""
    with contextlib.ExitStack() as stack:
        try:
            status, why = 0, case(stack) or ""
        except Skip as skip:
            status, why = SKIPPED, skip
        except Failed as failed:
            status, why = 1, failed
    print(why, flush=True)
    sys.exit(status)


def expect(so, what):
    if not so:
        raise Failed(what)


def until(so, what, patience_s=PATIENCE_S):
    """Asks until `so` gives something true, and gives that back."""
    end = time.monotonic() + patience_s
    while not (answer := so()):
        if time.monotonic() > end:
            raise Failed(f"in vain waited for: {what() if callable(what) else what}")
        time.sleep(0.1)
    return answer


def command(*words):
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != 0:
        raise Failed(f"{' '.join(words)}: {done.stdout.strip()}")
    return done.stdout


class Program:
    """A program that runs beside the case, its output in a file below /out; killed at the end if it still runs."""

    def __init__(self, stack, name, *words):
        self.log = pathlib.Path(f"/out/{name}.log")
        with open(self.log, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        stack.callback(self.kill)

    def said(self):
        return self.log.read_text(errors="replace")

    def running(self):
        return self.process.poll() is None

    def kill(self, number=signal.SIGKILL):
        if self.running():
            self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


class Daemon(Program):
    """groundlined with these settings over its defaults; capture_left is capture.left, mount_body__mask mount.body_mask."""

    def __init__(self, stack, **settings):
        words = []
        for key, value in {**settings, "publish_url": URL, "realtime_lock__memory": "off"}.items():
            words += ["--set", f"{key.replace('__', ' ').replace('_', '.').replace(' ', '_')}={value}"]
        super().__init__(stack, "groundlined", "/w/bin/groundlined", *words)
        until(lambda: "ready" in self.said() or not self.running(), "the daemon's word that it is ready")
        expect(self.running(), lambda: f"the daemon ended: {self.said()[-300:]}")

    def end(self):
        """By SIGTERM, which shall end it in order."""
        status = self.kill(signal.SIGTERM)
        expect(status == 0, f"the daemon ended with status {status} after SIGTERM")

    def placed(self):
        """Of each thread: its name, the processors it may run on, its scheduling policy."""
        threads = []
        for task in pathlib.Path(f"/proc/{self.process.pid}/task").iterdir():
            status = dict(line.split(":", 1) for line in (task / "status").read_text().splitlines())
            policy = os.sched_getscheduler(int(task.name)) & ~os.SCHED_RESET_ON_FORK
            threads.append((status["Name"].strip(), status["Cpus_allowed_list"].strip(), policy))
        return threads

    def resources(self):
        """Threads, descriptors, memory taken, and how much of the heaps it has touched, in kB.

        Not counted as touched: mappings of a MB and more, which are of a fixed size and made at the start (what frames
        need, stacks); which of their pages were used so far depends on which slots of the hand-overs were.
        """
        process = pathlib.Path(f"/proc/{self.process.pid}")

        def descriptors():
            time.sleep(0.03)
            return len(os.listdir(process / "fd"))

        status = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
        touched_kb = size_kb = 0
        heap = False
        for key, *values in (line.split() for line in (process / "smaps").read_text().splitlines()):
            if not key.endswith(":"):
                heap = values[-1] == "[heap]"
            elif key == "Size:":
                size_kb = int(values[0])
            elif key == "Anonymous:" and (heap or size_kb < 1024):
                touched_kb += int(values[0])
        # The supervisor has a file open now and then, for a moment.
        return (int(status["Threads"]), min(descriptors() for _ in range(10)), int(status["VmData"].split()[0]),
                touched_kb)


class Radio(Program):
    """Everything said on LCM since it was made: lcm-logger records, this reads along."""

    def __init__(self, stack, prepare=True):
        if prepare:
            command("ip", "route", "replace", "224.0.0.0/4", "dev", "lo")
            command("sysctl", "-qw", "net.core.rmem_max=16000000", "net.core.rmem_default=16000000")
        self.file = pathlib.Path("/tmp/lcm.log")
        self.file.unlink(missing_ok=True)
        super().__init__(stack, "lcm-logger", "lcm-logger", "-q", "--flush-interval=50", f"--lcm-url={URL}", self.file)
        self.position = 0
        self.health, self.masks, self.previews = [], [], []
        until(lambda: self.file.exists() or not self.running(), "lcm-logger")

    def listen(self):
        for channel, data in events(self.file, self.position):
            if channel is None:
                self.position = data
            elif channel == "GROUNDLINE_HEALTH":
                self.health.append(health_t.decode(data))
            elif channel == "GROUNDLINE_MASK":
                self.masks.append(mask_t.decode(data))
            elif channel == "GROUNDLINE_PREVIEW":
                self.previews.append(image_t.decode(data))
        return self

    def now(self):
        """The newest health message."""
        self.listen()
        return self.health[-1] if self.health else None

    def wait(self, so, what):
        """Until a health message that comes from now on is so."""
        self.listen()
        heard = len(self.health)

        def fresh():
            self.listen()
            return next((health for health in self.health[heard:] if so(health)), None)

        return until(fresh, lambda: f"{what}; health: {told(self.now())}")

    def wait_running(self, pairs=3):
        """Until the daemon runs and that many more masks have come."""
        self.listen()
        heard = len(self.masks)
        health = self.wait(lambda h: h.state == health_t.STATE_RUNNING, "state running")
        until(lambda: len(self.listen().masks) >= heard + pairs, lambda: f"{pairs} more masks; {told(self.now())}")
        return health

    def wait_blind(self):
        """Until the daemon says that pairs came once but do so no more, and shows that it is blind."""
        health = self.wait(lambda h: h.state == health_t.STATE_STALLED, "state stalled")
        expect(health.verdict == mask_t.VERDICT_BLIND and health.reasons & mask_t.REASON_NO_FRAMES,
               f"stalled, but not blind for want of frames: {told(health)}")
        return health


def events(file, position):
    """Channel and bytes of each whole event of an LCM log; last (None, position to go on from)."""
    with open(file, "rb") as log:
        log.seek(position)
        while len(head := log.read(28)) == 28:
            _, _, _, name_bytes, data_bytes = struct.unpack(">IQQII", head)
            body = log.read(name_bytes + data_bytes)
            if len(body) < name_bytes + data_bytes:
                break
            position += 28 + len(body)
            yield body[:name_bytes].decode(), body[name_bytes:]
        yield None, position


def counters(health):
    return {counter.name: counter.value for counter in health.counters}


def told(health):
    """A health message in a line."""
    if health is None:
        return "none"
    some = ", ".join(f"{name} {value}" for name, value in counters(health).items() if value > 0)
    return f"{STATES[health.state]}, {VERDICTS[health.verdict]}, reasons {health.reasons:#x}, {some}"


def need_driver(name):
    """Skips where the daemon does not know that capture driver."""
    done = subprocess.run(["/w/bin/groundlined", "--check-config", "--set", f"capture.driver={name}", "--set",
                           "capture.left=/dev/video0", "--set", "capture.right=/dev/video1"],
                          capture_output=True, text=True, check=False)
    if done.returncode == 78 and "capture.driver" in done.stderr + done.stdout:
        raise Skip(f"this groundlined has no capture driver {name}")


def vivid():
    """Two cameras /dev/video0 and 1."""
    command("modprobe", "vivid", "n_devs=2", "node_types=0x1,0x1", "num_inputs=1,1", "input_types=0,0")
    command("udevadm", "settle")
    return "/dev/video0", "/dev/video1"


def loopback(devices=2):
    """Loopback devices, no cameras before somebody feeds them."""
    numbers = ",".join(str(10 + i) for i in range(devices))
    command("modprobe", "v4l2loopback", f"devices={devices}", f"video_nr={numbers}", "max_buffers=4",
            "exclusive_caps=" + ",".join("1" * devices))
    command("udevadm", "settle")
    return [f"/dev/video{10 + i}" for i in range(devices)]


def feed(stack, *feeds, form="GREY", rate=4, options=()):
    """Starts feeding, e.g. ("/dev/video10", FRAMES / "left"); back when the devices are cameras."""
    words = [f"{device}={folder}" for device, folder in feeds]
    feeder = Program(stack, "feed", "python3", "-u", "/w/vm/feed.py", "--size", f"{SIZE[0]}x{SIZE[1]}", "--format", form,
                     "--rate", str(rate), *options, *words)
    until(lambda: "feeding" in feeder.said() or not feeder.running(), "the feeder")
    expect(feeder.running(), f"the feeder ended: {feeder.said()[-300:]}")
    return feeder


def camera_settings(left, right, **more):
    return {"capture_driver": "v4l2", "capture_left": left, "capture_right": right, "capture_width": SIZE[0],
            "capture_height": SIZE[1], **more}


def vivid_settings(left, right):
    """Its cameras run free, so any two pictures of one period are a pair."""
    return camera_settings(left, right, capture_height=180, capture_rate__hz=5, capture_pair__tolerance__ms=110)


def expect_no_masks(radio, listen_s=2):
    """Of a robot that is blind."""
    before = len(radio.listen().masks)
    time.sleep(listen_s)
    expect(len(radio.listen().masks) == before, "masks came from no pictures")


def frame_number(preview):
    """Which rendered frame a preview shows; None where its number is not all black and white."""
    scale = -(-SIZE[0] // preview.width)
    number = 0
    for bit in range(8):
        at = 3 * ((16 * bit + 8) // scale) + (8 // scale) * preview.row_stride
        level = preview.data[at]
        if 64 < level < 192:
            return None
        number |= (level > 128) << bit
    return number
