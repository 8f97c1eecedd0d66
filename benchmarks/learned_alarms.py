# SPDX-License-Identifier: Apache-2.0
"""Hours of ordinary drives in MuJoCo: alarms of slip and of sticking, against the truth.

Run from the repository: python -m benchmarks.learned_alarms [--hours H] [--seed S]

Each drive is drawn at random from what the model lets pass: straight, curves, turns on the spot,
backward, rests. All sensors have noise. It needs the extra `bench`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
import typer
from scipy.stats import chi2

from benchmarks.drives import PERIOD, SPEED, run_in_processes
from benchmarks.grounds import all_grounds
from benchmarks.learned_soil import make_ground
from benchmarks.learning import add_noise, told_rover
from benchmarks.measure import print_table
from rover_physics import Rover, Terrain, judge_poses
from rover_planner.errors import PlanningError
from rover_planner.learning.drive_log import RATES, TIME, YAW, X, Y
from rover_planner.learning.ground_learner import GroundEstimate, GroundLearner
from rover_planner.simulator.mujoco_rover import MujocoRover
from support.learning_drives import row_of_plant
from support.reference_drives import drive_ground

TURN, RADII = 0.1, (0.8, 3.0)
"""Rate of turns on the spot [rad/s], and smallest and largest radius of curves [m]."""
PARTS, LASTS = 6, (5.0, 14.0)
"""Number of parts of a drive, and shortest and longest duration of each [s]."""
MARGIN = 1.0
"""Least distance of the course from the map's edge [m]."""
TRUE_SLIP, BEFORE = 0.1, 0.8
"""A wheel slips in truth if its tread slid by more than this share of what it rolled, in this time
before it is noticed [s]."""
LEVER = 0.4
"""Distance of the wheels from the middle of turns on the spot [m]."""
STAYS, STAYED_FOR = 0.1, 1.2
"""A rover is stuck in truth if it goes on for this time [s] by less than this share of what its
treads roll."""


@dataclass(frozen=True)
class Alarms:
    """What a drive had told; None for what it had not."""

    ground: str
    """Name of the ground."""
    seed: int
    """Seed of course and noise; the learner hears commands if it is odd."""
    seconds: float
    """Its duration [s]."""
    slip: bool | None
    """Whether a wheel slipped in truth when this was first told."""
    stuck: bool | None
    """Whether the rover was stuck in truth when this was first told."""
    faults: str
    """Sensors that were not believed, and why."""

    @property
    def counts(self) -> tuple[bool, ...]:
        """What is false of slip, sticking and sensors, then what is true."""
        false = self.slip is False, self.stuck is False, bool(self.faults)
        return (*false, self.slip is True, self.stuck is True)


@lru_cache(maxsize=1)
def grounds() -> dict[str, Terrain]:
    """Return the grounds by name."""
    more = {"waves": make_ground(1)} | {
        kind.replace("_", " "): drive_ground(kind, 12.0) for kind in ("slope", "cross_slope")
    }
    return all_grounds() | more


def draw_course(ground: Terrain, seed: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return a start (3,) and parts (k, 3) of a course: speed, yaw rate, duration.

    None if there is none that the model lets pass.
    """
    rng, rover = np.random.default_rng(seed), told_rover()
    low, high = np.array(ground.bounds[::2]) + MARGIN, np.array(ground.bounds[1::2]) - MARGIN
    for _ in range(300):
        start = np.append(rng.uniform(low, high), rng.uniform(-np.pi, np.pi))
        parts = np.array([draw_part(rng) for _ in range(PARTS)])
        poses, curvature = follow(start, parts)
        if (poses[:, :2] < low).any() or (poses[:, :2] > high).any():
            continue
        if judge_poses(rover, ground, poses, curvature)[1].traversable:
            return start, parts
    return None


def draw_part(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return speed [m/s], yaw rate [rad/s] and duration [s]."""
    side, duration = rng.choice([-1.0, 1.0]), rng.uniform(*LASTS)
    match rng.choice(["straight", "curve", "curve", "on the spot", "backward", "rest"]):
        case "straight":
            return SPEED, 0.0, duration
        case "curve":
            return SPEED, side * SPEED / rng.uniform(*RADII), duration
        case "on the spot":
            return 0.0, side * TURN, duration
        case "backward":
            return -SPEED, 0.0, duration
    return 0.0, 0.0, LASTS[0]


def commands_of(parts: np.ndarray, period: float) -> np.ndarray:
    """Return speed and yaw rate (n, 2) in each period of a course."""
    return np.repeat(parts[:, :2], np.round(parts[:, 2] / period).astype(int), axis=0)


def follow(start: np.ndarray, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (n, 3) each half second along a course, and their curvatures (n,)."""
    period = 0.5
    speed, turn = commands_of(parts, period).T
    yaw = start[2] + period * (np.cumsum(turn) - 0.5 * turn)
    steps = period * np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), turn])
    with np.errstate(divide="ignore", invalid="ignore"):
        curvatures = np.where(turn == 0.0, 0.0, turn / speed)
    return np.cumsum(np.vstack([start, steps]), axis=0), np.append(0.0, curvatures)


def drive(ground: Terrain, start: np.ndarray, parts: np.ndarray) -> Iterator[np.ndarray]:
    """Return rows of a drive without noise, slip speeds (n, 6) and commanded speeds (n,)."""
    plant = MujocoRover(told_rover(), ground, tuple(start.tolist()))
    driven = []
    for speed, turn in commands_of(parts, PERIOD).tolist():
        plant.drive(speed, turn, PERIOD)
        row = row_of_plant(plant, (len(driven) + 1) * PERIOD)
        driven.append((row, plant.measure_contacts().slip_speeds, speed))
        if plant.state().stopped:
            break
    return map(np.array, zip(*driven, strict=True))


def listen(name: str, seed: int) -> Alarms | None:
    """Drive and listen to the learner; None if there is no course, or no standing at its start."""
    ground = grounds()[name]
    course = draw_course(ground, seed)
    if course is None:
        return None
    try:
        rows, slips, commands = drive(ground, *course)
    except PlanningError:
        return None
    rover = told_rover()
    learner, faults = GroundLearner(rover, ground), {}
    noisy = add_noise(rows, "strong" if seed % 3 == 0 else "usual", seed)
    for row, command in zip(noisy, commands, strict=True):
        if seed % 2:
            learner.commanded = float(command)
        if learner.take(row):
            faults |= learner.estimate.faults
    told = learner.estimate
    return Alarms(
        name,
        seed,
        float(rows[-1, TIME] - rows[0, TIME]),
        slipped_in_truth(told, rows, slips, rover),
        stuck_in_truth(told, rows, rover),
        ", ".join(f"{wheel}: {why}" for wheel, why in faults.items()),
    )


def slipped_in_truth(
    told: GroundEstimate, rows: np.ndarray, slips: np.ndarray, rover: Rover
) -> bool | None:
    """Return whether a wheel slipped in truth when it was said; None if it was not."""
    if told.slip_time is None:
        return None
    since = rows[:, TIME] - told.slip_time
    then = (since > -BEFORE) & (since <= 0.1)
    rolled = rover.wheel.radius * np.abs(rows[then][:, RATES]).mean(axis=0)
    return bool((slips[then].mean(axis=0) > TRUE_SLIP * np.maximum(rolled, 0.1 * SPEED)).any())


def stuck_in_truth(told: GroundEstimate, rows: np.ndarray, rover: Rover) -> bool | None:
    """Return whether the rover was stuck in truth when it was said; None if it was not."""
    if told.immobilised_time is None:
        return None
    since = rows[:, TIME] - told.immobilised_time
    then = rows[(since > -STAYED_FOR - 0.3) & (since <= 0.0)]
    way = np.hypot(*(then[-1] - then[0])[[X, Y]]) + LEVER * abs(then[-1, YAW] - then[0, YAW])
    rolled = rover.wheel.radius * np.abs(then[:, RATES].mean(axis=0)).mean()
    return bool(way < STAYS * rolled * (then[-1, TIME] - then[0, TIME]))


def rate(count: int, hours: float) -> str:
    """Return a number an hour with its 95 % interval, of a Poisson distribution."""
    if not count:
        return f"0 (below {3.0 / hours:.1f})"
    low, high = 0.5 * chi2.ppf(0.025, 2 * count), 0.5 * chi2.ppf(0.975, 2 * count + 2)
    return f"{count / hours:.1f} ({low / hours:.1f} to {high / hours:.1f})"


def main(
    hours: Annotated[float, typer.Option(help="Hours.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of the drives.")] = 1,
) -> None:
    """Drive, and print the alarms by ground."""
    mean = PARTS * (0.5 * sum(LASTS) * 5.0 + LASTS[0]) / 6.0
    count, names = round(3600.0 * hours / mean), list(grounds())
    jobs = [(names[k % len(names)], 1000 * seed + k) for k in range(count)]
    heard = [one for one in run_in_processes(listen, jobs) if one]
    rows: list[tuple] = []
    for name in (*names, "all"):
        own = [one for one in heard if name in (one.ground, "all")]
        driven = sum(one.seconds for one in own) / 3600.0
        counts = np.array([one.counts for one in own], int).reshape(-1, 5).sum(axis=0)
        *false, slipped, stuck = counts.tolist()
        cells = [rate(n, driven) for n in false] if name == "all" else false
        rows.append((name, driven, *cells, slipped, stuck))
    for one in heard:
        if any(one.counts[:3]):
            print(one)
    headings = "slip", "stuck", "sensor", "slipped in truth", "stuck in truth"
    columns = {"ground": "", "hours": ".2f"} | dict.fromkeys(headings, "")
    print_table("False alarms in ordinary drives; in the last row per hour", columns, rows)


if __name__ == "__main__":
    typer.run(main)
