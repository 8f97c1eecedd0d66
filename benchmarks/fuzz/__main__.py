"""Runs the fuzzer: python -m benchmarks.fuzz [--seed N] [--count N] [--where inside|dds|both]."""

import argparse
import sys

from benchmarks.fuzz.inside import fuzz_inside
from benchmarks.fuzz.over_dds import fuzz_over_dds


def main() -> int:
    """Throw the inputs, half of them in this process, and return 1 if there was a defect."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the random inputs (default 1)")
    parser.add_argument("--count", type=int, default=12_000, help="inputs (default 12000)")
    parser.add_argument("--where", choices=("inside", "dds", "both"), default="both")
    words = parser.parse_args()
    shares = 2 if words.where == "both" else 1
    defects = 0
    if words.where != "dds":
        tally = fuzz_inside(words.seed, words.count // shares)
        tally.show("adapters and services in this process")
        defects += len(tally.defects)
    if words.where != "inside":
        tally = fuzz_over_dds(words.seed, words.count - words.count // 2 * (shares - 1))
        tally.show("running nodes over DDS")
        defects += len(tally.defects)
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
