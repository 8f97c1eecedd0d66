# SPDX-License-Identifier: Apache-2.0
"""Drives in MuJoCo with traction control, and which of them the planner promises.

Run from the repository: python -m benchmarks.control_margin [--count N] [--seed S] [--calibrate]
It needs the extra `bench`. Its results are in docs/validation.md.
"""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.chance import MODEL_STDS
from benchmarks.drives import BY_MAP, drive, run_in_processes
from benchmarks.grounds import Obstacle
from benchmarks.measure import print_table
from rover_physics import Rover, judge_path, load_rover
from rover_physics.names import EQUAL, OPTIMAL
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from support.reference_drives import drive_path, unlimited

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
MARGINS = (0.0, 0.1, 0.2, 0.3)
"""Control margins that are tried."""
KNOWN = dict.fromkeys(
    ("friction", "friction_per_wheel", "max_torque", "max_torque_per_wheel"), 0.0
)
"""Uncertainty of what the drives have as the planner is told it."""
PROMISES = (
    *(f"control margin {margin:g}" for margin in MARGINS),
    f"chance up to {ACCEPTED_CHANCE:g}",
    "the same, friction and torque known",
)
"""What a promise asks for."""
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


def find_promises(obstacle: Obstacle) -> tuple[bool, ...]:
    """Return which of PROMISES are given; none if the obstacle does not need traction control.

    The rover has only the limits that MuJoCo knows.
    """
    rover, ground, path = unlimited(load_rover("lsr1")), obstacle.ground, drive_path()
    known = replace(rover, uncertainty=replace(rover.uncertainty, **KNOWN))
    asked = obstacle.options(OPTIMAL)

    def passes(one: Rover, accepted: float | None = None, **changes: Any) -> bool:
        options = replace(asked, **changes)
        return judge_path(one, ground, path, options, accepted_chance=accepted)[1].traversable

    if passes(rover, policy=EQUAL):
        return (False,) * len(PROMISES)
    margins = [passes(rover, control_margin=margin) for margin in MARGINS]
    return (*margins, passes(rover, ACCEPTED_CHANCE), passes(known, ACCEPTED_CHANCE))


def find_chance(obstacle: Obstacle, model_std: float) -> float:
    """Return the chance that traction control fails, friction and torque limit known."""
    rover = unlimited(load_rover("lsr1"))
    known = replace(rover.uncertainty, **KNOWN, model=model_std)
    asked = replace(rover, uncertainty=known), obstacle.ground, drive_path()
    verdict = judge_path(*asked, obstacle.options(OPTIMAL), accepted_chance=1.0)[1]
    return verdict.failure_chance


def draw_passable(count: int, seed: int) -> dict[Obstacle, tuple[bool, ...]]:
    """Return obstacles that are passable with traction control and not without, with PROMISES."""
    rng, promised = np.random.default_rng(seed), {}
    while True:
        drawn = [draw_obstacle(rng) for _ in range(BATCH)]
        found = run_in_processes(find_promises, [(obstacle,) for obstacle in drawn])
        for obstacle, promises in zip(drawn, found, strict=True):
            if promises[0]:
                promised[obstacle] = promises
            if len(promised) == count:
                return promised


def calibrate(obstacles: list[Obstacle], passed: np.ndarray) -> None:
    """Print the scores of model errors on drives (n,)."""
    jobs = [(obstacle, std) for std in MODEL_STDS for obstacle in obstacles]
    told = np.reshape(list(run_in_processes(find_chance, jobs)), (len(MODEL_STDS), -1))
    rows = []
    for std, chance in zip(MODEL_STDS, told, strict=True):
        loss = -np.log(np.where(passed, 1.0 - chance, chance).clip(0.005))
        rows.append((f"{std:g}", ((chance - ~passed) ** 2).mean(), loss.mean()))
    columns = {"model error": "", "Brier score": ".4f", "log loss": ".4f"}
    print_table("Calibration, friction and torque known", columns, rows)


def main(
    count: Annotated[int, typer.Option(help="Number of obstacles.")] = 100,
    seed: Annotated[int, typer.Option(help="Seed of the obstacles.")] = 1,
    calibrate_too: Annotated[
        bool, typer.Option("--calibrate", help="Score model errors on these drives.")
    ] = False,
) -> None:
    """Draw, judge and drive; print how many promises are kept, and what of the rest passes."""
    promised = draw_passable(count, seed)
    jobs = [(obstacle, BY_MAP, TRIES, MOST_TIME) for obstacle in promised]
    passed = np.array([one.passed for one in run_in_processes(drive, jobs)])
    rows = []
    for name, given in zip(PROMISES, np.array(list(promised.values())).T, strict=True):
        kept = int((given & passed).sum())
        rows.append((name, share(kept, int(given.sum())), share(kept, int(passed.sum()))))
    title = f"{count} obstacles that need traction control, contact angles from the map"
    columns = dict.fromkeys(("promised by", "promises kept", "promised of what passes"), "")
    print_table(title, columns, rows)
    if calibrate_too:
        calibrate(list(promised), passed)


def share(count: int, of: int) -> str:
    """Return a share as text."""
    return f"{count} of {of} ({count / max(of, 1):.1%})"


if __name__ == "__main__":
    typer.run(main)
