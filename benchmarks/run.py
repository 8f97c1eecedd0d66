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
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.measure import Figure, console, print_figures, write_figures

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
RESULTS = ROOT / "bench_output" / "results.json"
TOPICS = tuple(sorted(path.stem.removeprefix("bench_") for path in HERE.glob("bench_*.py")))


def run_topic(topic: str, checkout: Path = ROOT) -> list[Figure]:
    """Return the figures of a topic, measured by a checkout in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "figures.json"
        command = [sys.executable, "-m", "benchmarks.run", "--only", f"bench_{topic}", str(out)]
        environment = os.environ | {"PYTHONPATH": str(checkout)}
        subprocess.run(command, check=True, cwd=checkout, env=environment)
        rows = json.loads(out.read_text())
    return [Figure(**{k: v for k, v in row.items() if k != "met"}) for row in rows]


def compare(topic: str, other: Path, rounds: int, this: Path = ROOT) -> list[Figure]:
    """Return the ratios of a topic's figures, this checkout's over another's, run in turns."""
    found: dict[Path, list[list[Figure]]] = {this: [], other: []}
    for turn in range(rounds):
        for checkout in (this, other) if turn % 2 else (other, this):
            found[checkout].append(run_topic(topic, checkout))
    here, there = (_medians(figures) for figures in found.values())
    return [
        Figure(topic, name, here[name] / value, "x", against=f"{value:.4g} there", repeats=rounds)
        for name, value in there.items()
        if name in here and value
    ]


def _medians(rounds: list[list[Figure]]) -> dict[str, float]:
    """Return the median of each figure over all rounds, by name."""
    names = [figure.name for figure in rounds[0]]
    return {
        name: statistics.median(f.value for figures in rounds for f in figures if f.name == name)
        for name in names
    }


def check_topics(topics: list[str] | None) -> list[str] | None:
    """Return the topics; refuse one that is not there."""
    for topic in topics or ():
        if topic not in TOPICS:
            raise typer.BadParameter(f"no topic {topic!r}; topics are {', '.join(TOPICS)}")
    return topics


def main(
    topics: Annotated[
        list[str] | None, typer.Argument(help="Default: all.", callback=check_topics)
    ] = None,
    against: Annotated[Path | None, typer.Option(help="Another checkout.")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds with --against.")] = 3,
) -> None:
    """Run topics, print a table, and write it to bench_output/results.json."""
    figures: list[Figure] = []
    for topic in topics or TOPICS:
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
