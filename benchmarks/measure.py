"""How benchmarks measure and report: medians of repeats, one table, one JSON file.

What is compared is called in turns in one run, so that a busy machine slows both down.
"""

import json
import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

REPEATS = 5
WIDTH = 140
"""Columns of the table where it goes to no terminal."""


@dataclass(frozen=True)
class Figure:
    """One measured number."""

    topic: str
    """What part of the product it is about."""
    name: str
    """What was measured."""
    value: float
    """Median of the repeats."""
    unit: str
    """Its unit; "x" for a ratio of two numbers measured in the same run."""
    target: float | None = None
    """What it should be; None where it is for information."""
    at_least: bool = False
    """Whether the target is the least that will do; else the most."""
    against: str = ""
    """What a ratio or a difference is against, measured in turns with it."""
    repeats: int = REPEATS
    """How many repeats it is the median of; 1 for what is counted, not timed."""

    @property
    def met(self) -> bool | None:
        """Whether the target is met, None without one."""
        if self.target is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target


def median_time(
    function: Callable[[], object],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.process_time,
) -> float:
    """Return the median time [s] of a call after one that warms up.

    The default clock counts what the process used, so that other programs on the machine disturb
    least; it counts all threads, so time several threads with `time.perf_counter`.
    """
    return median_times([function], repeats, clock)[0]


def median_times(
    functions: Sequence[Callable[[], object]],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.process_time,
) -> list[float]:
    """Return the median time [s] of each function, called in turns; the clock as `median_time`."""
    for function in functions:
        function()
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(repeats):
        for taken, function in zip(times, functions, strict=True):
            start = clock()
            function()
            taken.append(clock() - start)
    return [statistics.median(taken) for taken in times]


def quantile(values: Sequence[float], share: float) -> float:
    """Return the smallest of the values that at least a share (0 to 1) of them do not exceed."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def show(figures: list[Figure]) -> None:
    """Print the figures as a table."""
    table = Table(title="Medians; targets with a tick are met")
    for heading in ("topic", "measured", "against"):
        table.add_column(heading)
    for heading in ("repeats", "value", "target", ""):
        table.add_column(heading, justify="right")
    for figure in figures:
        target, mark = "", ""
        if figure.target is not None:
            target = f"{'>=' if figure.at_least else '<='} {figure.target:,g}"
            mark = "✓" if figure.met else "✗"
        large = abs(figure.value) >= 1000.0
        value = f"{figure.value:,.0f}" if large else f"{figure.value:.3g}"
        told = str(figure.repeats), f"{value} {figure.unit}", target, mark
        table.add_row(figure.topic, figure.name, figure.against, *told)
    console = Console()
    console.width = console.width if console.is_terminal else WIDTH
    console.print(table)


def write(figures: list[Figure], path: Path) -> None:
    """Write the figures as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [{**asdict(figure), "met": figure.met} for figure in figures]
    path.write_text(json.dumps(rows, indent=1) + "\n")
