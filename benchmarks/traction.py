# SPDX-License-Identifier: Apache-2.0
"""Closed-loop drives in MuJoCo with speed servos, equal torques and the quadratic program.

Run from the repository: python -m benchmarks.traction
It needs the extra `bench`. Its results are in docs/traction.md.
"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import typer

from benchmarks.drives import (
    BY_MAP,
    BY_MOTION,
    EQUAL_TORQUES,
    OBSTACLES,
    SERVO,
    DriveResult,
    drive,
    run_in_processes,
)
from benchmarks.grounds import Obstacle
from benchmarks.measure import OUTPUT, print_table, write_rows

CONTROLLERS = (SERVO, EQUAL_TORQUES, BY_MOTION, BY_MAP)
ROUGH = ("rocks", "relief")
"""Kinds of rough ground."""
SUMS = {
    "slip": ("slip [m]", 3, np.sum),
    "torque": ("torque [N m]", 3, np.mean),
    "energy": ("energy [J]", 1, np.sum),
    "mean_utilisation": ("utilisation", 2, np.mean),
}
"""Columns of the summary: heading, digits, and sum or mean over all obstacles."""

Drives = dict[tuple[Obstacle, str], DriveResult]
"""Drives by obstacle and controller."""


def sum_up(drives: Drives, kinds: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return sums and means by controller, over the obstacles of these kinds that all passed."""
    obstacles = [o for o, name in drives if name == SERVO and o.kind in kinds]
    common = [o for o in obstacles if all(drives[o, name].passed for name in CONTROLLERS)]
    sums: dict[str, dict[str, Any]] = {}
    for name in CONTROLLERS:
        lost = [o.label for o in obstacles if drives[o, SERVO].passed > drives[o, name].passed]
        passed = sum(drives[o, name].passed for o in obstacles)
        sums[name] = {"passed": passed, "of": len(obstacles), "lost": lost}
        for key, (_, _, join) in SUMS.items():
            values = [getattr(drives[o, name], key) for o in common] or [np.nan]
            sums[name][key] = float(join(values))
    return sums


def print_sums(sums: dict[str, dict[str, Any]], title: str) -> None:
    """Print a row for each controller, with its differences from the servos."""

    def compare(row: dict[str, Any], key: str, digits: int) -> str:
        change = 100.0 * (row[key] / sums[SERVO][key] - 1.0) if sums[SERVO][key] else 0.0
        return f"{row[key]:.{digits}f} ({change:+.0f} %)"

    rows = []
    for name, row in sums.items():
        cells = [compare(row, key, digits) for key, (_, digits, _) in SUMS.items()]
        rows.append((name, f"{row['passed']} of {row['of']}", ", ".join(row["lost"]), *cells))
    headings = ("controller", "passed", "lost", *(heading for heading, _, _ in SUMS.values()))
    print_table(title, dict.fromkeys(headings, ""), rows)


def draw_sums(sums: dict[str, dict[str, Any]], picture: Path) -> None:
    """Draw slip, torque, energy and utilisation of the controllers relative to the servos."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    axes = figure.subplots()
    width, places = 0.8 / len(CONTROLLERS), np.arange(len(SUMS))
    colours = ("#999999", "#e69f00", "#56b4e9", "#0072b2")
    for k, (name, colour) in enumerate(zip(CONTROLLERS, colours, strict=True)):
        shares = [sums[name][key] / sums[SERVO][key] for key in SUMS]
        axes.bar(places + k * width, shares, width, label=name, color=colour)
    axes.set_xticks(
        places + 1.5 * width, ("slip distance", "torque effort", "energy", "utilisation")
    )
    axes.set_ylabel("share of the speed servos'")
    figure.legend(loc="outside upper center", ncols=len(CONTROLLERS), frameon=False)
    figure.savefig(picture, dpi=150)


def main() -> None:
    """Run the drives, print tables, and write JSON and a picture to bench_output."""
    jobs = [(obstacle, name) for obstacle in OBSTACLES for name in CONTROLLERS]
    drives = dict(zip(jobs, run_in_processes(drive, jobs), strict=True))
    everything = sum_up(drives, [obstacle.kind for obstacle in OBSTACLES])
    rough = sum_up(drives, ROUGH)
    print_sums(everything, "All obstacles that all controllers passed: sums and means")
    print_sums(rough, "Rocks and relief that all controllers passed: sums and means")
    rows = [asdict(o) | {"controller": name} | asdict(row) for (o, name), row in drives.items()]
    write_rows({"drives": rows, "all": everything, "rough": rough}, OUTPUT / "traction.json")
    draw_sums(everything, OUTPUT / "traction.png")


if __name__ == "__main__":
    typer.run(main)
