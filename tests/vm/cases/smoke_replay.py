"""The same frames give the same disparities and masks on the emulated processor (SSE 4 at most) as on this one."""
import hashlib
import pathlib

import robot

RENDERED = "drive?width=320&height=240&focal=250&boxes=2&seed=7&frames=130"


def hashes(folder):
    files = [file for kind in ("disparity", "vdisparity", "mask") for file in sorted((folder / kind).iterdir())]
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest()
            for file in [*files, folder / "frames.jsonl"]}


def case(stack):
    outside = pathlib.Path("/w/replayed")
    inside = pathlib.Path("/tmp/replayed")
    robot.command("/w/bin/groundline", "replay", f"synthetic:{RENDERED}", "--frames", "2", "--quiet", "--out", str(inside))
    expected, got = hashes(outside), hashes(inside)
    robot.expect(len(expected) == 7, f"outside there are {len(expected)} files")
    other = [name for name in expected if got.get(name) != expected[name]]
    robot.expect(not other, f"not the same bytes: {', '.join(other)}")
    return "disparities, v-disparities and masks of 2 frames and frames.jsonl are the same bytes"


robot.run(case)
