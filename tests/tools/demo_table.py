#!/usr/bin/env python3
"""demo_table.py RESULTS EVALUATIONS SET...: one line for each replayed set.

Reads RESULTS/SET/frames.jsonl and, where it exists, EVALUATIONS/SET.json (`groundline evaluate --json`).
"""
import collections
import json
import pathlib
import statistics
import sys

HEAD = ("set", "frames", "trusted", "degraded", "blind", "ground m", "answered", "bad-3", "obstacles", "free", "drops",
        "free")


def percent(value):
    return "-" if value is None else f"{100.0 * value:.1f} %"


def row(results, evaluations, name):
    with open(results / name / "frames.jsonl", encoding="utf-8") as file:
        frames = [json.loads(line) for line in file]
    verdicts = collections.Counter(frame["verdict"] for frame in frames)
    heights = [frame["ground"]["height_m"] for frame in frames
               if frame["ground"] and frame["ground"]["height_m"] is not None]
    found = {}
    evaluation = evaluations / f"{name}.json"
    if evaluation.exists():
        found = json.loads(evaluation.read_text(encoding="utf-8"))
    disparity = found.get("disparity") or {}
    terrain = found.get("terrain") or {}
    return (name, str(len(frames)), str(verdicts["trusted"]), str(verdicts["degraded"]), str(verdicts["blind"]),
            f"{statistics.median(heights):.2f}" if heights else "-", percent(disparity.get("density")),
            percent(disparity.get("bad3")), percent(terrain.get("obstacle_recall")),
            percent(terrain.get("obstacle_called_free")), percent(terrain.get("drop_recall")),
            percent(terrain.get("drop_called_free")))


def main():
    results, evaluations = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    rows = [HEAD] + [row(results, evaluations, name) for name in sys.argv[3:]]
    widths = [max(len(line[column]) for line in rows) for column in range(len(HEAD))]
    for line in rows:
        print("  ".join(text.ljust(width) if column == 0 else text.rjust(width)
                        for column, (text, width) in enumerate(zip(line, widths))))
    print("\nverdicts and ground height (median) of all frames; against the truth, where there is one: share of its\n"
          "pixels with a disparity, share of those off by more than 3 px, share of obstacle pixels found, and\n"
          "shown as traversable (free), and the same of pixels of drops")


if __name__ == "__main__":
    main()
