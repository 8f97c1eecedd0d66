# SPDX-License-Identifier: Apache-2.0
"""Measurement and reports of benchmarks: medians of repeats, tables, JSON files.

Functions that are compared run in turns, so that other load on the machine affects all of them.
"""

import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rover_physics import Terrain, save_terrain

REPEATS = 5
"""Default number of repeats of a measurement."""
WIDTH = 140
"""Width of a table in characters when the output is not a terminal."""
OUTPUT = Path("bench_output")
"""Folder of the files with results."""


@dataclass(frozen=True)
class Figure:
    """One measured number."""

    topic: str
    """Part of the product, such as "pose"."""
    name: str
    """Name of the measured quantity."""
    value: float
    """Median of the repeats."""
    unit: str
    """Unit; "x" for a ratio of two numbers measured in the same run."""
    target: float | None = None
    """Target; None if there is none."""
    at_least: bool = False
    """True if the target is a minimum; otherwise it is a maximum."""
    against: str = ""
    """Reference of a ratio or difference, measured in turns with it."""
    repeats: int = REPEATS
    """Number of repeats; 1 for counts."""

    @property
    def met(self) -> bool | None:
        """True if the target is met; None without a target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target


@dataclass(frozen=True)
class Run:
    """Times of a command."""

    seconds: float
    """Time by the clock [s]."""
    cpu: float
    """CPU time of all its processes [s]."""


def run_command(*words: object) -> Run:
    """Run `rover_planner` with words."""
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "rover_planner", *map(str, words)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Run(time.perf_counter() - began, cpu)


def run_predict(folder: Path, ground: Terrain, poses: np.ndarray) -> Run:
    """Run `predict` of the rover lsr1 for poses (n, 3), with its files in a folder."""
    files = [folder / name for name in ("ground.npz", "poses.npz", "out.npz")]
    save_terrain(files[0], ground)
    np.savez(files[1], poses=poses)
    return run_command("predict", "lsr1", *files)


def peak_memory() -> float:
    """Return the peak memory so far [MiB] of a child process."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def median_time(function: Callable[[], object], repeats: int = REPEATS) -> float:
    """Return the median CPU time [s] of a call; see `median_times`."""
    return median_times([function], repeats)[0]


def median_times(
    functions: Sequence[Callable[[], object]],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.process_time,
) -> list[float]:
    """Return the median time [s] of each function, called in turns; first calls only warm up.

    The default clock is the CPU time of the process, which other programs on the machine affect
    least. It adds up all threads; use `time.perf_counter` to time several threads.
    """
    for function in functions:
        function()
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(repeats):
        for taken, function in zip(times, functions, strict=True):
            start = clock()
            function()
            taken.append(clock() - start)
    return [statistics.median(taken) for taken in times]


def console(stderr: bool = False) -> Console:
    """Return a console whose tables are not cut off where the output is a file."""
    made = Console(stderr=stderr)
    made.width = made.width if made.is_terminal else WIDTH
    return made


def print_table(
    title: str, columns: Mapping[str, str], rows: Iterable[Sequence[str | float | None]]
) -> None:
    """Print rows of texts and numbers as a table; numbers are aligned to the right.

    Args:
        title: What the table has.
        columns: Format of the numbers in each column, by heading.
        rows: The cells; None stays empty.
    """
    table = Table(title=escape(title))
    forms = list(columns.values())
    texts = [list(map(_text, row, forms)) for row in rows]
    for k, heading in enumerate(columns):
        numeric = bool(texts) and all(row[k][:1] in "-+0123456789" for row in texts)
        table.add_column(escape(heading), justify="right" if numeric else "left")
    for row in texts:
        table.add_row(*map(escape, row))
    console().print(table)


def _text(cell: str | float | None, form: str) -> str:
    if cell is None:
        return ""
    return cell if isinstance(cell, str) else format(cell, form)


def print_figures(figures: Sequence[Figure]) -> None:
    """Print figures as a table."""
    headings = ("topic", "measured", "against", "repeats", "value", "target", "")
    title = "Medians; targets with a tick are met"
    print_table(title, dict.fromkeys(headings, ""), map(_row, figures))


def _row(figure: Figure) -> tuple[str | float, ...]:
    value = f"{figure.value:{',.0f' if abs(figure.value) >= 1000.0 else '.3g'}} {figure.unit}"
    sign = ">=" if figure.at_least else "<="
    target = "" if figure.target is None else f"{sign} {figure.target:,g}"
    mark = {None: "", True: "✓", False: "✗"}[figure.met]
    shown = value.strip(), target, mark
    return (figure.topic, figure.name, figure.against, figure.repeats, *shown)


def write_figures(figures: Sequence[Figure], path: Path) -> None:
    """Write figures as JSON."""
    write_rows([{**asdict(figure), "met": figure.met} for figure in figures], path)


def write_rows(rows: Any, path: Path) -> None:
    """Write what was measured as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(rows, indent=1) + "\n")
