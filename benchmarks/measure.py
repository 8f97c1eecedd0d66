"""How benchmarks measure and report: medians of repeats, one table, one JSON file."""

import json
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

REPEATS = 5


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

    @property
    def met(self) -> bool | None:
        """Whether the target is met, None without one."""
        if self.target is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target


def median_time(
    function: Callable[[], object], repeats: int = REPEATS, clock=time.process_time
) -> float:
    """Return the median time [s] of a call after one that warms up.

    The default clock counts what the process used, so that other programs on the machine disturb
    least; it counts all threads, so time several threads with `time.perf_counter`.
    """
    function()
    times = []
    for _ in range(repeats):
        start = clock()
        function()
        times.append(clock() - start)
    return statistics.median(times)


def show(figures: list[Figure]) -> None:
    """Print the figures as a table."""
    table = Table(title="Medians; targets with a tick are met")
    for heading in ("topic", "measured"):
        table.add_column(heading)
    for heading in ("value", "target", ""):
        table.add_column(heading, justify="right")
    for figure in figures:
        target, mark = "", ""
        if figure.target is not None:
            target = f"{'>=' if figure.at_least else '<='} {figure.target:g}"
            mark = "✓" if figure.met else "✗"
        value = f"{figure.value:,.4g} {figure.unit}"
        table.add_row(figure.topic, figure.name, value, target, mark)
    Console().print(table)


def write(figures: list[Figure], path: Path) -> None:
    """Write the figures as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [{**asdict(figure), "met": figure.met} for figure in figures]
    path.write_text(json.dumps(rows, indent=1) + "\n")
