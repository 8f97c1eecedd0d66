# SPDX-License-Identifier: Apache-2.0
"""Drives in MuJoCo over ground that the planner calls passable with traction control.

Run from the repository: python -m benchmarks.control_margin [--count N] [--seed S] [--least M]
It needs the extra `bench`. Its results are in docs/validation.md.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
import typer

from benchmarks.drives import BY_MAP, BY_MOTION, Obstacle, drive, run_in_processes
from benchmarks.measure import print_table
from rover_physics import SweepOptions, judge_path, load_rover
from rover_physics.names import EQUAL, OPTIMAL
from rover_planner.parameters.traverse_server import TraverseServerParameters
from support.reference_drives import drive_path, unlimited

SOURCES = {"map": BY_MAP, "motion": BY_MOTION}
"""Controllers by the source of their contact angles."""
TRIES, MOST_TIME = 3, 5.0
"""Attempts at one place, and time after which a rover has failed over that of the drive."""
SIZES = {
    "step": (0.05, 0.25),
    "bump_one_side": (0.05, 0.25),
    "ditch": (0.1, 0.7),
    "slope": (8.0, 32.0),
    "cross_slope": (8.0, 32.0),
    "rocks": (0.05, 0.16),
    "relief": (0.05, 0.14),
}
"""Smallest and largest size of each kind of obstacle."""
FRICTIONS = 0.35, 1.0
"""Smallest and largest friction coefficient."""
TORQUES = 0.3, 2.5
"""Smallest and largest torque limit [N m]; their logarithm is uniform."""
MARGINS = (0.0, 0.04, 0.08, 0.1, 0.12, 0.16, 0.2, 0.24, 0.3)
"""Control margins that are tried."""
BATCH = 40
"""Obstacles that are drawn at once."""


def draw_obstacle(rng: np.random.Generator) -> Obstacle:
    """Draw a ground, a friction and a torque limit."""
    kind = str(rng.choice(list(SIZES)))
    low, high = np.log(TORQUES)
    return Obstacle(
        kind=kind,
        size=float(rng.uniform(*SIZES[kind])),
        friction=float(rng.uniform(*FRICTIONS)),
        max_torque=float(np.exp(rng.uniform(low, high))),
        seed=int(rng.integers(1, 1_000_000)),
    )


def find_margin(obstacle: Obstacle) -> float:
    """Return the largest of the MARGINS that a drive keeps.

    NaN if it does not need traction control, negative if it is impassable with it, too. The
    rover has only the limits that MuJoCo knows.
    """
    rover, ground, path = unlimited(load_rover("lsr1")), obstacle.ground, drive_path()
    options = SweepOptions(
        friction=obstacle.friction, max_torque=obstacle.max_torque, policy=EQUAL
    )
    if judge_path(rover, ground, path, options)[1].traversable:
        return float("nan")

    kept = -1.0
    for margin in MARGINS:
        asked = replace(options, policy=OPTIMAL, control_margin=margin)
        if not judge_path(rover, ground, path, asked)[1].traversable:
            break
        kept = margin
    return kept


def draw_promised(count: int, seed: int, least: float, workers: int) -> dict[Obstacle, float]:
    """Return obstacles that are passable with traction control by at least a margin."""
    rng, margins = np.random.default_rng(seed), {}
    while True:
        drawn = [draw_obstacle(rng) for _ in range(BATCH)]
        found = run_in_processes(find_margin, [(obstacle,) for obstacle in drawn], workers)
        for obstacle, margin in zip(drawn, found, strict=True):
            if margin >= least:
                margins[obstacle] = margin
            if len(margins) == count:
                return margins


def main(
    count: Annotated[int, typer.Option(help="Number of obstacles.")] = 100,
    seed: Annotated[int, typer.Option(help="Seed of the obstacles.")] = 1,
    least: Annotated[float, typer.Option(help="Least control margin.")] = 0.0,
    workers: Annotated[int, typer.Option(help="Number of processes.")] = 2,
) -> None:
    """Draw, judge and drive; print how many drives pass, by the margin that they keep."""
    margins = draw_promised(count, seed, least, workers)
    jobs = [(o, name, TRIES, MOST_TIME) for o in margins for name in SOURCES.values()]
    found = run_in_processes(drive, jobs, workers)
    drives = {job[:2]: row for job, row in zip(jobs, found, strict=True)}
    rows = []
    for margin in MARGINS:
        kept = [obstacle for obstacle, left in margins.items() if left >= margin]
        passed = [sum(drives[o, name].passed for o in kept) for name in SOURCES.values()]
        shares = (f"{n} of {len(kept)} ({n / max(len(kept), 1):.1%})" for n in passed)
        rows.append((f"{margin:.2f}", *shares))
    names = (f"contact angles from {source}" for source in SOURCES)
    default = TraverseServerParameters().control_margin
    title = f"Passed, of drives that keep a control margin (default {default:g})"
    print_table(title, ("control margin", *names), rows)


if __name__ == "__main__":
    typer.run(main)
