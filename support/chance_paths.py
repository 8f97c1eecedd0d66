# SPDX-License-Identifier: Apache-2.0
"""Paths with a friction and a torque limit that are told, and what is drawn around these."""

import json
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from rover_physics import Rover, SweepOptions, Terrain, judge_path, load_rover
from rover_physics.rover.uncertainty import Uncertainty
from support.reference_drives import DRIVES, drive_ground, unlimited

CHANCES = DRIVES.with_name("chances.jsonl")
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


@dataclass(frozen=True)
class ChancePath:
    """A path over a ground of the reference drives, or over rocks or relief."""

    kind: str
    """Kind of the ground."""
    size: float
    """Height, width or RMS height [m], or angle [deg]."""
    seed: int
    """Seed of rocks and relief."""
    curvature: float
    """Curvature [1/m], left positive; 0 is straight ahead."""
    friction: float
    """Friction coefficient that the planner is told."""
    max_torque: float
    """Torque limit that the planner is told [N m]."""
    speed: float = FAST
    """Nominal speed of the drives [m/s]."""

    @property
    def ground(self) -> Terrain:
        """The ground."""
        return drive_ground(self.kind, self.size, self.seed)

    @property
    def poses(self) -> np.ndarray:
        """Waypoints (n, 3) x, y [m] and yaw [rad]."""
        along = np.linspace(0.0, LENGTH, round(LENGTH / SPACING) + 1)
        turn = self.curvature * along
        ahead = along * np.sinc(turn / np.pi)
        aside = 0.5 * turn * along * np.sinc(turn / (2.0 * np.pi)) ** 2
        return np.column_stack([START + ahead, aside, turn])

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


@dataclass(frozen=True)
class DrivenPath:
    """A path and what became of its drives."""

    path: ChancePath
    """The path."""
    stream: int
    """Seed of `draw_path`."""
    passed: str
    """1 for each drive that arrived, 0 for the others, in the order of `draw_truths`."""


def read_driven_paths(file: Path = CHANCES) -> list[DrivenPath]:
    """Return the paths of a file of benchmarks.chance_drives."""
    rows = map(json.loads, file.read_text().splitlines())
    names = [field.name for field in fields(ChancePath)]
    return [
        DrivenPath(
            ChancePath(**{name: row[name] for name in names if name in row}),
            row["stream"],
            row["passed"],
        )
        for row in rows
    ]


def find_chance(path: ChancePath, model_std: float | None = None) -> tuple[float, bool]:
    """Return the chance that a path fails, and whether the plain verdict refuses it.

    Uncertain are friction and torque limit as they were drawn, and the model; its error is the
    default one or `model_std`.
    """
    told = Uncertainty(friction=FRICTION_STD, max_torque=TORQUE_STD)
    drawn = {"friction", "max_torque", "model"}
    others = {one.name: 0.0 for one in fields(told) if one.name not in drawn}
    known = replace(told, model=told.model if model_std is None else model_std, **others)
    rover = replace(path.rover(path.max_torque), uncertainty=known)
    options = SweepOptions(policy="servo", friction=path.friction)
    verdict = judge_path(rover, path.ground, path.poses, options, accepted_chance=1.0)[1]
    return verdict.failure_chance, not verdict.traversable
