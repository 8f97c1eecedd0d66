"""Measurement and reports of benchmarks: medians of repeats, one table, one JSON file.

Functions that are compared run in turns, so that other load on the machine affects all of them.
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
"""Default number of repeats of a measurement."""
WIDTH = 140
"""Width of the table in characters when the output is not a terminal."""


@dataclass(frozen=True)
class Figure:
    """One measured number."""

    topic: str
    """Part of the product, such as "pose"."""
    name: str
    """What was measured."""
    value: float
    """Median of the repeats."""
    unit: str
    """Unit; "x" for a ratio of two numbers measured in the same run."""
    target: float | None = None
    """Target; None if there is none."""
    at_least: bool = False
    """Whether the target is a minimum; otherwise it is a maximum."""
    against: str = ""
    """Reference of a ratio or difference, measured in turns with it."""
    repeats: int = REPEATS
    """Number of repeats; 1 for counts."""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without a target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target


def median_time(
    function: Callable[[], object],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.process_time,
) -> float:
    """Return the median time [s] of a call; the first call warms up and is not counted.

    The default clock is the CPU time of the process, which other programs on the machine affect
    least. It adds up all threads; use `time.perf_counter` to time several threads.
    """
    return median_times([function], repeats, clock)[0]


def median_times(
    functions: Sequence[Callable[[], object]],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.process_time,
) -> list[float]:
    """Return the median time [s] of each function, called in turns; see `median_time`."""
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
    """Return the quantile of the values for a share of 0 to 1, without interpolation."""
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
