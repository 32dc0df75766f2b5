#!/usr/bin/env python3
"""Runs the daemon at 30 pairs a second for a while, with and without a competing load, and tells its latencies.

soak.py --build BUILD --folder FOLDER [--minutes 10] [--load none,processors]
Rendered pairs of 640x480, 64 disparities, paced by their stamps. Figures are those of the daemon's own health
messages. Exit status 1 where pairs got lost uncounted, or for one pair of a hundred all stages together take half a period
or more; reading is not one of these, since unpacking files stands in for cameras there.
"""
import argparse
import contextlib
import os
import pathlib
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time

RATE_HZ = 30
GROUP, PORT = "239.255.76.67", 7667
SCENE = "drive?seed=7"
FRAMES = 90
STAGES = ("rectify", "match", "ground", "classify", "publish")
LOSSES = ("frames_overwritten", "results_overwritten", "publish_failures", "frames_bad")


def make_frames(groundline, folder):
    """The rendered drive with its calibration, its files named by their stamps, 30 a second."""
    if (folder / "done").exists():
        return
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([groundline, "synth", SCENE, "--frames", str(FRAMES), "--out", folder], check=True)
    for side in ("left", "right"):
        for number, file in enumerate(sorted((folder / side).iterdir())):
            file.rename(folder / side / f"{10**18 + number * 10**9 // RATE_HZ}{file.suffix}")
    (folder / "done").touch()


def make_types(folder):
    types = sorted((pathlib.Path(__file__).parent / "../../include/groundline/lcmtypes").resolve().glob("*.lcm"))
    subprocess.run(["lcm-gen", "--python", "--ppath", folder, *types], check=True)
    sys.path.insert(0, str(folder))


def own_network():
    """A network of this process alone, with nothing but lo; as root. Else the machine's."""
    if os.geteuid() != 0:
        return
    os.unshare(os.CLONE_NEWNET) if hasattr(os, "unshare") else reexecute()
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    subprocess.run(["ip", "route", "replace", f"{GROUP}/32", "dev", "lo"], check=True)


def reexecute():
    """Python learns unshare in 3.12."""
    if os.environ.get("SOAK_UNSHARED") != "1":
        os.environ["SOAK_UNSHARED"] = "1"
        os.execvp("unshare", ["unshare", "--net", sys.executable, *sys.argv])


def listener():
    radio = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    radio.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    radio.bind((GROUP, PORT))
    radio.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                     struct.pack("4s4s", socket.inet_aton(GROUP), socket.inet_aton("127.0.0.1")))
    radio.settimeout(5)
    return radio


def messages(radio, until):
    """Channel and bytes of LCM's small messages until that time."""
    while time.monotonic() < until:
        data = radio.recv(65536)
        if data[:4] == b"LC02":
            channel, _, body = data[8:].partition(b"\0")
            yield channel.decode(), body


def run(daemon, frames, seconds, load):
    """The last health message of a run, and the daemon's CPU time in seconds."""
    from groundline.health_t import health_t

    with contextlib.ExitStack() as stack:
        for _ in range(load):
            busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(busy.wait)
            stack.callback(busy.kill)
        radio = stack.enter_context(listener())
        words = []
        for setting in ("capture.driver=files", f"capture.source={frames}", "stereo.disparities=64",
                        f"publish.url=udpm://{GROUP}:{PORT}?ttl=0"):
            words += ["--set", setting]
        process = subprocess.Popen([daemon, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        stack.callback(process.kill)
        newest, masks = None, 0
        for channel, body in messages(radio, time.monotonic() + seconds):
            if channel == "GROUNDLINE_HEALTH":
                newest = health_t.decode(body)
            masks += channel == "GROUNDLINE_MASK"
        process.send_signal(signal.SIGTERM)
        for channel, body in messages(radio, time.monotonic() + 1):
            if channel == "GROUNDLINE_HEALTH":
                newest = health_t.decode(body)
            masks += channel == "GROUNDLINE_MASK"
            if newest.state == health_t.STATE_STOPPING:
                break
        usage = os.wait4(process.pid, 0)[2]
        process.returncode = 0
    return newest, masks, usage.ru_utime + usage.ru_stime


def tell(name, health, masks, cpu_s, seconds):
    counts = {counter.name: counter.value for counter in health.counters}
    latencies = {each.name: each for each in health.latencies}
    whole = latencies["exposure_to_publish"]
    stages_ms = latencies["all_stages"].p99_ms
    unaccounted = (counts["frames_read"] - counts["frames_overwritten"] - counts["frames_processed"],
                   counts["frames_processed"] - counts["results_overwritten"] - counts["results_delivered"])
    print(f"{name}: exposure to publish p50 {whole.p50_ms:.1f} ms, p99 {whole.p99_ms:.1f}, max {whole.max_ms:.1f}; "
          f"{counts['frames_read']} pairs, {masks} masks heard, "
          + ", ".join(f"{loss} {counts[loss]}" for loss in LOSSES))
    print("  stages p50/p99/max, ms: "
          + ", ".join(f"{stage} {latencies[stage].p50_ms:.1f}/{latencies[stage].p99_ms:.1f}/{latencies[stage].max_ms:.1f}"
                      for stage in ("read", *STAGES, "all_stages"))
          + f", of a period of {1000 / RATE_HZ:.1f}; "
          f"{100 * cpu_s / seconds:.0f} % of one processor; real-time scheduling {health.realtime_scheduling}, "
          f"memory locked {health.memory_locked}")
    # At the end one pair may be on its way in each stage.
    lost = any(not 0 <= each <= 1 for each in unaccounted)
    if lost:
        print(f"  NOT ACCOUNTED FOR: {unaccounted[0]} pairs before processing, {unaccounted[1]} results after it")
    return not lost and stages_ms < 500 / RATE_HZ


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--load", default="none,processors", help="none, processors (one busy program each), or both")
    options = parser.parse_args()
    own_network()
    options.folder.mkdir(parents=True, exist_ok=True)
    make_frames(options.build / "src/cli/groundline", options.folder / "frames")
    make_types(options.folder / "types")
    good = True
    for load in options.load.split(","):
        seconds = 60 * options.minutes
        found = run(options.build / "src/daemon/groundlined", options.folder / "frames", seconds,
                    0 if load == "none" else os.cpu_count())
        good = tell("idle" if load == "none" else f"{os.cpu_count()} busy programs beside it", *found, seconds) and good
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
