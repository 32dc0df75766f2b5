#!/usr/bin/env python3
"""Say in a few lines what a CTest run did: how many tests, how many skipped and why. Reads its LastTest.log."""
import collections
import re
import sys


def main():
    try:
        with open(sys.argv[1], encoding="utf-8", errors="replace") as file:
            log = file.read()
    except (IndexError, OSError) as problem:
        print(f"No summary of the tests: {problem}", file=sys.stderr)
        return 1
    blocks = re.split(r"^\d+/\d+ Testing: .*$", log, flags=re.MULTILINE)[1:]
    reasons = collections.Counter()
    for block in blocks:
        if "Skip regular expression found in output" not in block:
            continue
        # GoogleTest writes "file:line: Skipped", then what the test said, then "[  SKIPPED ]".
        said = re.search(r": Skipped\n(.*?)\s*\[  SKIPPED \]", block, flags=re.DOTALL)
        reasons[" ".join(said.group(1).split()) if said and said.group(1).strip() else "no reason given"] += 1
    print(f"{len(blocks)} tests, {sum(reasons.values())} of them skipped{':' if reasons else '.'}")
    for reason, count in sorted(reasons.items(), key=lambda item: (-item[1], item[0])):
        print(f"  {count:4} {reason}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
