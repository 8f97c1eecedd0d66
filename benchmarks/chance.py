# SPDX-License-Identifier: Apache-2.0
"""Compares chances of failure with drives whose friction and torque limit were drawn.

Run from the repository: python -m benchmarks.chance [--calibrate] [--picture FILE] [--file FILE]
The drives are those of test/data/chances.jsonl, at 0.1 m/s, or of another file that
benchmarks.chance_drives has made (docs/validation.md).
"""

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import scipy  # loads `stats` where it is used: that takes a second
import typer

from benchmarks.grounds import Obstacle
from benchmarks.measure import print_table
from rover_physics import Rover, SweepOptions, judge_paths, load_rover
from rover_physics.rover.uncertainty import Uncertainty
from support.paths import arc_of, poses_at
from support.reference_cases import DATA
from support.reference_drives import unlimited

CHANCES = DATA / "chances.jsonl"
"""Drives at 0.1 m/s."""
HELD_OUT = 2
"""Stream of the paths that calibrate nothing."""
TOLD = "friction drawn within 10 % and torque limit within 5 % of what is told"

FAST = 0.1
"""Speed of most drives [m/s]: the largest of the wheels, to keep the run time short."""
START, LENGTH = -0.8, 1.7
"""x of the start, where y and yaw are 0, and length [m]."""
SPACING = 0.01
"""Distance between waypoints [m]."""
SIZES = {
    "step": (0.05, 0.22),
    "bump_one_side": (0.05, 0.25),
    "ditch": (0.1, 0.6),
    "slope": (10.0, 38.0),
    "cross_slope": (10.0, 38.0),
    "rocks": (0.05, 0.15),
    "relief": (0.05, 0.14),
}
"""Smallest and largest size of each kind of ground."""
FRICTIONS, TORQUES = (0.4, 1.0), (0.4, 2.0)
"""Smallest and largest of what is told: friction coefficient and, in the logarithm, torque limit
[N m]."""
CURVED = 0.4
"""Share of the paths that are arcs."""
TIGHTEST = 1.2
"""Largest curvature of an arc [1/m]."""
FRICTION_STD, TORQUE_STD = 0.10, 0.05
"""Relative standard deviations of friction and torque limit about what is told."""
MODEL_STDS = (0.03, 0.06, 0.08, 0.1, 0.15, 0.2)
"""Model errors among which the calibration chooses."""
EDGES = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)
"""Edges of the ranges of chances in the reliability table."""
ACCEPTED = 0.05
"""Chance below which a path counts as accepted."""
SURE = 0.95
"""Share of draws from which a path counts as one that passes."""


@dataclass(frozen=True, kw_only=True)
class ChancePath(Obstacle):
    """A path over a ground of the reference drives, with what the planner is told."""

    curvature: float
    """Curvature [1/m], left positive; 0 is straight ahead."""
    speed: float = FAST
    """Nominal speed of the drives [m/s]."""

    @property
    def poses(self) -> np.ndarray:
        """Waypoints (n, 3) x, y [m] and yaw [rad]."""
        along = np.linspace(0.0, LENGTH, round(LENGTH / SPACING) + 1)
        return arc_of(self.curvature, along) + poses_at(START)

    def rover(self, max_torque: float) -> Rover:
        """Return the rover lsr1 with a torque limit [N m], and MuJoCo's limits only."""
        rover = replace(unlimited(load_rover("lsr1")), nominal_speed=self.speed)
        return replace(rover, wheel=replace(rover.wheel, max_torque=max_torque))


def draw_path(seed: int, number: int) -> ChancePath:
    """Return path `number` of a stream."""
    rng = np.random.default_rng([seed, number])
    kind = list(SIZES)[number % len(SIZES)]
    curved = rng.uniform() < CURVED
    return ChancePath(
        kind=kind,
        size=round(float(rng.uniform(*SIZES[kind])), 4),
        seed=int(rng.integers(1, 1_000_000)),
        curvature=round(float(rng.uniform(-TIGHTEST, TIGHTEST)), 3) if curved else 0.0,
        friction=round(float(rng.uniform(*FRICTIONS)), 3),
        max_torque=round(float(np.exp(rng.uniform(*np.log(TORQUES)))), 3),
    )


def draw_truths(seed: int, number: int, path: ChancePath, draws: int) -> np.ndarray:
    """Return frictions and torque limits [N m] (draws, 2) of the drives of path `number`."""
    rng = np.random.default_rng([seed, number, 1])
    z = rng.standard_normal((draws, 2)).clip(-3.0, 3.0)
    return np.array([path.friction, path.max_torque]) * (1.0 + z * [FRICTION_STD, TORQUE_STD])


@dataclass(frozen=True, kw_only=True)
class DrivenPath(ChancePath):
    """A path and what became of its drives: a line of a file."""

    stream: int
    """Seed of `draw_path`."""
    number: int
    """Number of the path in this stream."""
    passed: str
    """1 for each drive that arrived, 0 for the others, in the order of `draw_truths`."""


def read_driven_paths(file: Path = CHANCES) -> list[DrivenPath]:
    """Return the paths of a file of benchmarks.chance_drives."""
    return [DrivenPath(**json.loads(line)) for line in file.read_text().splitlines()]


def find_chance(path: ChancePath, model_std: float | None = None) -> tuple[float, bool]:
    """Return the chance that a path fails, and whether the plain verdict refuses it.

    Uncertain are friction and torque limit as they were drawn, where the follower keeps the rover,
    and the model; its error is the default one or `model_std`. A drive ends where its path does:
    whether the rover is trapped there is not asked.
    """
    told = Uncertainty(friction=FRICTION_STD, max_torque=TORQUE_STD)
    differ = {"friction", "max_torque", "position", "heading", "model"}
    others = {one.name: 0.0 for one in fields(told) if one.name not in differ}
    known = replace(told, model=told.model if model_std is None else model_std, **others)
    rover = replace(path.rover(path.max_torque), uncertainty=known)
    options = SweepOptions(policy="servo", friction=path.friction)
    asked = {"check_entrapment": False, "accepted_chance": 1.0}
    _, verdict = judge_paths(rover, path.ground, [path.poses], options, **asked)[0]
    return verdict.failure_chance, not verdict.traversable


@dataclass(frozen=True)
class Compared:
    """Predictions about paths and what became of them."""

    chance: np.ndarray
    """(n,) chance of failure."""
    refused: np.ndarray
    """(n,) whether the plain verdict refuses the path."""
    drives: np.ndarray
    """(n,) number of drives."""
    failed: np.ndarray
    """(n,) number of them that failed."""

    @property
    def shares(self) -> np.ndarray:
        """(n,) share of the drives that failed."""
        return self.failed / self.drives

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval (Wilson) of the share of all drives that fail."""
        if not len(self.drives):
            return 0.0, 1.0
        test = scipy.stats.binomtest(self.failed.sum(), self.drives.sum())
        return test.proportion_ci(method="wilson")

    def average(self, values: np.ndarray) -> float:
        """Return the mean over drives of values of paths (n,)."""
        return float(np.average(values, weights=self.drives))

    def brier(self, told: np.ndarray) -> float:
        """Return the Brier score of told chances (n,), over drives."""
        return self.average(self.shares * (1.0 - told) ** 2 + (1.0 - self.shares) * told**2)

    def select(self, rows: np.ndarray) -> "Compared":
        """Return the paths where `rows` (n,) is True."""
        return Compared(*(values[rows] for values in vars(self).values()))


def compare(paths: Sequence[DrivenPath], model_std: float | None = None) -> Compared:
    """Predict paths, with a model error other than the default if one is given."""
    chance, refused = zip(*(find_chance(path, model_std) for path in paths), strict=True)
    counts = [(len(path.passed), path.passed.count("0")) for path in paths]
    return Compared(np.array(chance), np.array(refused), *np.array(counts).T)


def split_by_chance(found: Compared) -> Iterator[tuple[str, Compared]]:
    """Yield the ranges of EDGES that have paths, and these."""
    for low, high in itertools.pairwise(EDGES):
        part = found.select((found.chance >= low) & ((found.chance < high) | (high == 1.0)))
        if len(part.chance):
            yield f"{low:g} to {high:g}", part


def reliability(name: str, part: Compared) -> tuple[str | float, ...]:
    """Return the row of the reliability table for a range of chances."""
    low, high = part.interval
    told, failed = part.average(part.chance), part.failed.sum() / part.drives.sum()
    interval = f"{low:.3f} to {high:.3f}"
    return name, len(part.chance), part.drives.sum(), told, failed, interval


def summary(name: str, found: Compared) -> tuple[str | float, ...]:
    """Return a row about a group of paths."""
    accepted = found.select(found.chance < ACCEPTED)
    sure = found.select(found.shares <= 1.0 - SURE)
    low, high = accepted.interval
    return (
        name,
        len(found.chance),
        found.brier(found.chance),
        found.brier(found.refused),
        f"{accepted.failed.sum()} of {accepted.drives.sum()} ({low:.1%} to {high:.1%})",
        f"{(sure.chance >= ACCEPTED).sum()} of {len(sure.chance)}",
    )


def calibrate(paths: Sequence[DrivenPath]) -> None:
    """Print the scores of model errors on the drives that calibrate."""
    rows = []
    for std in MODEL_STDS:
        found = compare(paths, std)
        told = found.chance.clip(0.005, 0.995)
        loss = -(found.shares * np.log(told) + (1.0 - found.shares) * np.log(1.0 - told))
        rows.append((f"{std:g}", found.brier(found.chance), found.average(loss)))
    columns = {"model error": "", "Brier score": ".4f", "log loss": ".4f"}
    print_table(f"Calibration on {len(paths)} paths", columns, rows)


def draw_picture(file: Path, found: Compared) -> None:
    """Draw told chances and observed shares, by path and by range."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], "k:", lw=1)
    shift = 0.012 * np.random.default_rng(0).standard_normal((2, len(found.chance)))
    axes.plot(found.chance + shift[0], found.shares + shift[1], "o", ms=4, alpha=0.35,
              label=f"a path, {found.drives.max()} drives")  # fmt: skip
    for number, (_, part) in enumerate(split_by_chance(found)):
        at = part.average(part.chance)
        axes.plot([at, at], part.interval, "C3", lw=2)
        axes.plot(at, part.average(part.shares), "C3s", label="" if number else "range, 95 %")
    axes.set_xlabel("predicted chance of failure")
    axes.set_ylabel("share of drives that failed")
    axes.legend(frameon=False)
    figure.savefig(file, dpi=110)


def main(
    calibrate_too: Annotated[
        bool, typer.Option("--calibrate", help="Score model errors on the other drives.")
    ] = False,
    picture: Annotated[Path | None, typer.Option(help="Picture to draw.")] = None,
    file: Annotated[Path, typer.Option(help="Drives.")] = CHANCES,
) -> None:
    """Print the tables."""
    driven = read_driven_paths(file)
    held = [path for path in driven if path.stream == HELD_OUT]
    if calibrate_too:
        calibrate([path for path in driven if path.stream != HELD_OUT])
    found = compare(held)
    columns = {"chance": "", "paths": "", "drives": "", "told": ".3f", "failed": ".3f", "95 %": ""}
    rows = itertools.starmap(reliability, split_by_chance(found))
    print_table(f"Reliability; {TOLD}", columns, rows)
    kinds = np.array([path.kind for path in held])
    curved = np.array([path.curvature != 0.0 for path in held])
    groups = {"all": curved | True, "curves": curved}
    groups |= {kind: kinds == kind for kind in sorted(set(kinds.tolist()))}
    columns = {"paths": "", "number": "", "Brier": ".3f", "plain": ".3f"}
    columns |= {f"failed below {ACCEPTED:g}": "", "sure ones refused": ""}
    some = [summary(name, found.select(own)) for name, own in groups.items() if own.any()]
    print_table("Paths", columns, some)
    if picture is not None:
        draw_picture(picture, found)


if __name__ == "__main__":
    typer.run(main)
