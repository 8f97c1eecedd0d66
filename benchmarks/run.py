# SPDX-License-Identifier: Apache-2.0
"""Runs benchmarks, prints one table and writes it as JSON: `make bench`.

Run from the repository: python -m benchmarks.run [TOPIC ...] [--against CHECKOUT] [--rounds N]

The topics are the files bench_*.py. Each runs in a process of its own, so that memory and threads
of one do not affect another. With --against, each topic runs in turns here and in another checkout
of the project, and the table has the ratios of the medians.
"""

import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from enum import StrEnum
from pathlib import Path
from statistics import median
from typing import Annotated

import typer

from benchmarks.measure import OUTPUT, Figure, console, print_figures, write_figures
from support.project.checkout import TOP

RESULTS = TOP / OUTPUT / "results.json"
FILES = sorted((TOP / "benchmarks").glob("bench_*.py"))
TOPICS = tuple(path.stem.removeprefix("bench_") for path in FILES)
Topic = StrEnum("Topic", TOPICS)


def run_topic(topic: str, checkout: Path = TOP) -> list[Figure]:
    """Return the figures of a topic, measured by a checkout in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "figures.json"
        command = [sys.executable, "-m", "benchmarks.run", "--only", f"bench_{topic}", str(out)]
        environment = os.environ | {"PYTHONPATH": str(checkout)}
        subprocess.run(command, check=True, cwd=checkout, env=environment)
        rows = json.loads(out.read_text())
    return [Figure(**{k: v for k, v in row.items() if k != "met"}) for row in rows]


def compare(topic: str, other: Path, rounds: int, this: Path = TOP) -> list[Figure]:
    """Return the ratios of a topic's figures, this checkout's over another's, run in turns."""
    here, there = defaultdict[str, list[float]](list), defaultdict[str, list[float]](list)
    for turn in range(rounds):
        for checkout in (this, other) if turn % 2 else (other, this):
            for figure in run_topic(topic, checkout):
                (here if checkout == this else there)[figure.name].append(figure.value)
    theirs = {name: median(values) for name, values in there.items() if name in here}
    ratio = {"unit": "x", "repeats": rounds}
    return [
        Figure(topic, name, median(here[name]) / value, against=f"{value:.4g} there", **ratio)
        for name, value in theirs.items()
        if value
    ]


def main(
    topics: Annotated[list[Topic] | None, typer.Argument(help="Default: all.")] = None,
    against: Annotated[Path | None, typer.Option(help="Another checkout.")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds with --against.")] = 3,
) -> None:
    """Run topics, print a table, and write it to bench_output/results.json."""
    figures: list[Figure] = []
    for topic in topics or list(Topic):
        console(stderr=True).print(f"measuring: {topic}")
        figures += compare(topic, against.resolve(), rounds) if against else run_topic(topic)
    print_figures(figures)
    write_figures(figures, RESULTS)
    console(stderr=True).print(f"written to {RESULTS}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--only"]:
        module = importlib.import_module(f"benchmarks.{sys.argv[2]}")
        write_figures(module.measure(), Path(sys.argv[3]))
    else:
        typer.run(main)
