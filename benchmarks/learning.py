# SPDX-License-Identifier: Apache-2.0
"""Drives in MuJoCo on ground of unknown friction: what is learned of it, against the truth.

Run from the repository: python -m benchmarks.learning [--drives N] [--seed S] [--example FOLDER]
It needs the extra `bench`. Drives are drawn at random: ground, friction, control, noise, rate.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.drives import (
    BY_MOTION,
    DROOP,
    END,
    PERIOD,
    SERVO,
    SPEED,
    START,
    follow_axis,
    rover_of,
    run_in_processes,
)
from benchmarks.grounds import Obstacle
from benchmarks.measure import print_table
from rover_physics import Rover, Terrain, load_rover
from rover_physics.terrain.grid import save_terrain
from rover_planner.learning import drive_log as log
from rover_planner.learning.friction_filter import FrictionEstimate
from rover_planner.learning.ground_learner import GroundEstimate, GroundLearner
from rover_planner.learning.wheel_odometry import GYRO_BIAS, GYRO_NOISE, WheelOdometry
from rover_planner.simulator.mujoco_rover import MujocoRover
from support.learning_drives import row_of_plant, scatter, write_csv

CONSTANT, SIDES, LINE = "constant", "per side", "at a line"
LAYOUTS = (CONSTANT, CONSTANT, SIDES, LINE)
"""Where friction changes: nowhere (half of the drives), at y = 0, at x = 0."""
SIZES = {
    "slope": (8.0, 26.0),
    "cross_slope": (5.0, 20.0),
    "rocks": (0.04, 0.10),
    "relief": (0.04, 0.10),
    "step": (0.04, 0.14),
    "bump_one_side": (0.04, 0.14),
}
"""Smallest and largest size of each kind of ground."""
NOISE = {
    "none": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "usual": (0.01, 0.001, 0.003, 0.002, 0.03, 0.003),
    "strong": (0.03, 0.004, 0.01, 0.005, 0.10, 0.01),
}
"""Drift of the position over the way, then standard deviations: position [m], attitude and yaw
[rad], suspension [rad], torque [N m], wheel rates [rad/s]."""
STAYED, HALTED, STUCK_FOR = 0.02, 0.1, 4.0
"""A rover that goes no farther than this [m], slower than this share of the commanded speed at
first, in more than this time [s] to the end, is stuck; one that slides along a step is not."""
MOTION_TIME = 0.5
"""Time over which its speed is taken [s]."""
BEFORE = 1.5
"""Time before a rover is said to be stuck over which its way is told [s]."""


@dataclass(frozen=True)
class LearningDrive:
    """A drive along +x and what the learner is told of it."""

    kind: str
    """Ground, as in `benchmarks.drives`."""
    size: float
    """Its size."""
    seed: int
    """Its seed, and that of the noise."""
    layout: str
    """Where friction changes."""
    frictions: tuple[float, float]
    """Friction on both sides of the change: right and left, or before and after."""
    controller: str
    """Control of the wheels."""
    timestep: float
    """Time step of MuJoCo [s]."""
    noise: str
    """Key of NOISE."""
    step: int
    """Rows of the log per PERIOD, inverse: every which row is kept."""

    @property
    def obstacle(self) -> Obstacle:
        """The ground, with the friction that a controller is told."""
        return Obstacle(self.kind, self.size, self.frictions[0], self.seed)

    @property
    def ground(self) -> Terrain:
        """The ground with its true friction."""
        ground = self.obstacle.ground
        if self.layout == CONSTANT:
            return ground
        rows, columns = np.indices(ground.elevation.shape)
        cells = ground.origin + ground.resolution * np.stack([columns, rows], axis=-1)
        return replace(ground, friction=self.find_friction(cells))

    def find_friction(self, places: np.ndarray) -> np.ndarray:
        """Return the friction (...) at places (..., 2)."""
        if self.layout == CONSTANT:
            return np.full(places.shape[:-1], self.frictions[0])
        return np.where(places[..., 1 if self.layout == SIDES else 0] < 0.0, *self.frictions)

    def add_noise(self, rows: np.ndarray) -> np.ndarray:
        """Return the rows that are kept, with noise."""
        return add_noise(rows, self.noise, self.seed, self.step)


EXAMPLE = LearningDrive("slope", 24.0, 1, CONSTANT, (0.4, 0.4), SERVO, 0.004, "usual", 1)
"""A drive that ends stuck, for docs/learning.md."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A drive as it was."""

    rows: np.ndarray
    """(n, log.WIDTH) rows without noise."""
    passed: bool
    """Whether it reached its end."""


def draw_drive(seed: int, number: int) -> LearningDrive:
    """Draw a drive."""
    rng = np.random.default_rng((seed, number))
    kind = str(rng.choice(list(SIZES)))
    layout = str(rng.choice(LAYOUTS))
    frictions = rng.uniform(0.25, 0.9, 2)
    if layout != CONSTANT and abs(np.log(frictions[0] / frictions[1])) < 0.4:
        frictions[1] = frictions[0] * 0.5 if frictions[0] > 0.55 else frictions[0] * 1.8
    return LearningDrive(
        kind=kind,
        size=float(rng.uniform(*SIZES[kind])),
        seed=int(rng.integers(1000)),
        layout=layout,
        frictions=(float(frictions[0]), float(frictions[1])),
        controller=str(rng.choice([SERVO, DROOP, BY_MOTION])),
        timestep=float(rng.choice([0.002, 0.004])),
        noise=str(rng.choice(list(NOISE))),
        step=int(rng.choice([1, 1, 2, 5])),
    )


def record(drive: LearningDrive) -> Recorded:
    """Drive in MuJoCo."""
    obstacle, start = drive.obstacle, (START, 0.0, 0.0)
    plant = MujocoRover(
        rover_of(obstacle), drive.ground, start, drive.frictions[0], drive.timestep
    )
    rows = [measure(plant) for _ in follow_axis(plant, obstacle, drive.controller, most_time=1.5)]
    return Recorded(np.array(rows).reshape(-1, log.WIDTH), bool(plant.pose()[0] >= END))


def measure(plant: MujocoRover) -> np.ndarray:
    """Return what is measured now, with the torques of the last step."""
    row = row_of_plant(plant, plant.time)
    row[log.TORQUES] = plant.wheel_torques
    return row


def add_noise(rows: np.ndarray, noise: str, seed: int, step: int = 1) -> np.ndarray:
    """Return every `step`-th row with noise, a key of NOISE."""
    rows = rows[::step].copy()
    drift, *sigmas = NOISE[noise]
    rng = np.random.default_rng(seed)
    ways = np.append(0.0, np.hypot(*np.diff(rows[:, [log.X, log.Y]], axis=0).T))
    scatter(rows, rng, *sigmas)
    course = rng.uniform(-np.pi, np.pi)
    rows[:, [log.X, log.Y]] += drift * np.cumsum(ways)[:, None] * [np.cos(course), np.sin(course)]
    return rows


Pair = tuple[FrictionEstimate, float]
"""An estimate and the truth."""


@dataclass(frozen=True)
class Learned:
    """What was learned of a drive, beside the truth."""

    drive: LearningDrive
    """The drive."""
    recorded: Recorded
    """What became of it."""
    estimate: GroundEstimate
    """The estimate at its end."""
    under: np.ndarray
    """(6,) friction under the wheels at its end."""
    early: FrictionEstimate | None
    """The friction when slip first bounds it."""
    stuck_time: float | None
    """When the rover was stuck in truth [s]."""
    noticed_time: float | None
    """When it was first said to be stuck from then on [s]; one that creeps may be before, too."""
    way_before_notice: float | None
    """Way [m] in the BEFORE seconds before it was said to be stuck, None if it was not."""

    @property
    def pairs(self) -> list[Pair]:
        """The friction and that under most wheels; per side, each with its own."""
        if self.drive.layout != SIDES:
            return [(self.estimate.friction, float(np.median(self.under)))]
        truths = np.median(self.under.reshape(2, -1), axis=1).tolist()
        return list(zip(self.estimate.sides.values(), truths, strict=True))


def learn(drive: LearningDrive) -> Learned | None:
    """Drive and learn; None where the rover could not stand at the start, or left the map."""
    recorded = record(drive)
    if len(recorded.rows) < 50:
        return None
    learner, early = GroundLearner(told_rover(), drive.obstacle.ground), None
    learner.commanded = SPEED
    said: list[float] = []
    for row in drive.add_noise(recorded.rows):
        is_new = learner.take(row)
        if is_new and learner.stuck and learner.window is not None:
            said.append(learner.window.time)
        if is_new and early is None:
            estimate = learner.estimate
            if estimate.slip_time is not None and estimate.friction.high is not None:
                early = estimate.friction
    if learner.window is None:
        return None
    under = drive.find_friction(learner.window.places)
    stuck, way = find_stuck(recorded), find_way(recorded, said[0]) if said else None
    noticed = next((time for time in said if stuck is not None and time >= stuck), None)
    return Learned(drive, recorded, learner.estimate, under, early, stuck, noticed, way)


def has_truth(estimate: FrictionEstimate, truth: float) -> bool:
    """Return whether the interval of a friction has the truth."""
    return estimate.low <= truth <= (estimate.high or np.inf)


def measure_yaw_rates(truth: np.ndarray, seed: int) -> np.ndarray:
    """Return the yaw rates [rad/s] that an IMU measured in a drive, of rows without noise."""
    rng, times = np.random.default_rng(seed), truth[:, log.TIME]
    noise = GYRO_NOISE / np.sqrt(np.median(np.diff(times))) * rng.standard_normal(len(truth))
    bias = GYRO_BIAS * rng.standard_normal()
    return np.asarray(np.gradient(truth[:, log.YAW], times) + noise + bias)


def print_odometry(learned: list[Learned]) -> None:
    """Print misses at the ends of drives without visual odometry, after those before with it.

    Friction is that which is told, and that which was learned on the drive with visual odometry.
    """
    rover = told_rover()
    teacher, found = WheelOdometry(rover), defaultdict[tuple[str, ...], list[Any]](list)
    for one in learned:
        drive, recorded = one.drive, one.recorded
        truth, rows = recorded.rows[:: drive.step], drive.add_noise(recorded.rows)
        yaw_rates = measure_yaw_rates(truth, drive.seed)
        told, known, pupil = (WheelOdometry(rover) for _ in range(3))
        for odometry in (told, known, pupil):
            odometry.forward, odometry.side = teacher.forward, teacher.side
        friction = one.estimate.friction
        known.friction, known.friction_deviation = friction.mean, friction.std
        yaws = []
        for row, yaw_rate in zip(rows, yaw_rates, strict=True):
            told.take(row, yaw_rate)
            known.take(row, yaw_rate)
            yaws.append(told.pose[2])
        between = 0.5 * np.add(yaws[:-1], yaws[1:])
        ways = rover.wheel.radius * rows[1:, log.RATES].mean(axis=1) * PERIOD * drive.step
        plain = np.array([np.cos(between), np.sin(between)]) @ ways
        c, s = np.cos(truth[0, log.YAW]), np.sin(truth[0, log.YAW])
        end = np.array([[c, s], [-s, c]]) @ (truth[-1] - truth[0])[[log.X, log.Y]]
        for name, odometry in {"told": told, "learned": known}.items():
            miss = odometry.pose[:2] - end
            nees = miss @ np.linalg.solve(odometry.covariance[:2, :2], miss)
            if one is not learned[0]:
                sizes = np.hypot(*miss), np.hypot(*(plain - end))
                ground = drive.kind if recorded.passed else "not arrived"
                found[ground, name].append((*sizes, nees))
        for row, yaw_rate in zip(rows, yaw_rates, strict=True):
            pupil.take(row, yaw_rate)
            pupil.learn(row[[log.X, log.Y, log.YAW]])
    table = []
    for kind, values in sorted(found.items()):
        own, plain_miss, nees = np.array(values).T
        better = plain_miss.mean() / own.mean()
        means = own.mean(), plain_miss.mean(), better, nees.mean()
        table.append((*kind, len(own), *means, np.mean(nees < 5.99)))
    columns = {"ground": "", "friction": "", "drives": "", "miss [m]": ".3f", "plain [m]": ".3f"}
    columns |= {"times better": ".1f", "NEES": ".1f", "within 95 %": ".0%"}
    title = "Wheel odometry at the ends of drives, without visual odometry"
    print_table(title, columns, table)


def told_rover() -> Rover:
    """Return the rover as the learner knows it."""
    return replace(load_rover("lsr1"), nominal_speed=SPEED)


def find_stuck(recorded: Recorded) -> float | None:
    """Return the time [s] from which a rover stayed to the end, None if it did not."""
    times, places = recorded.rows[:, log.TIME], recorded.rows[:, [log.X, log.Y]]
    away = np.hypot(*(places - places[-1]).T) >= STAYED
    half = round(0.5 * MOTION_TIME / PERIOD)
    before, after = slice(None, -2 * half), slice(2 * half, None)
    speeds = np.hypot(*(places[after] - places[before]).T) / (times[after] - times[before])
    stays = (speeds < HALTED * SPEED) & ~np.logical_or.accumulate(away[::-1])[::-1][half:-half]
    if recorded.passed or not stays.any():
        return None
    since = float(times[half + np.argmax(stays)])
    return since if times[-1] - since > STUCK_FOR else None


def find_way(recorded: Recorded, time: float) -> float:
    """Return the way [m] of a rover in the BEFORE seconds before a time [s]."""
    times, places = recorded.rows[:, log.TIME], recorded.rows[:, [log.X, log.Y]]
    before, here = np.searchsorted(times, [time - BEFORE, time]).clip(max=len(times) - 1)
    return float(np.hypot(*(places[here] - places[before])))


def main(
    drives: Annotated[int, typer.Option(help="Number of drives.")] = 60,
    seed: Annotated[int, typer.Option(help="Seed of the drives.")] = 1,
    example: Annotated[
        Path | None, typer.Option(help="Only write drive.csv and terrain.npz of a drive there.")
    ] = None,
) -> None:
    """Learn from drives and print errors and coverage."""
    if example is not None:
        example.mkdir(parents=True, exist_ok=True)
        write_csv(example / "drive.csv", EXAMPLE.add_noise(record(EXAMPLE).rows))
        save_terrain(example / "terrain.npz", EXAMPLE.obstacle.ground)
        return
    jobs = [(draw_drive(seed, number),) for number in range(drives)]
    learned = [one for one in run_in_processes(learn, jobs) if one is not None]
    print_summary(learned)
    print_odometry(learned)


def print_summary(learned: list[Learned]) -> None:
    """Print errors and coverage by layout of the friction, and what was noticed of sticking."""
    groups = {
        layout: [one.pairs for one in learned if one.drive.layout == layout]
        for layout in (CONSTANT, SIDES, LINE)
    }
    groups[f"{CONSTANT}, when slip first bounds it"] = [
        [(one.early, one.drive.frictions[0])]
        for one in learned
        if one.early is not None and one.drive.layout == CONSTANT
    ]
    rows = []
    for name, drives in groups.items():
        bounded = [pair for pairs in drives for pair in pairs if pair[0].high is not None]
        errors = np.array([abs(friction.mean / truth - 1.0) for friction, truth in bounded])
        within = [all(has_truth(*pair) for pair in pairs) for pairs in drives]
        shares = (np.median(errors), np.mean(errors < 0.1)) if bounded else (None, None)
        rows.append((name, len(drives), len(errors), *shares, np.mean(within)))
    columns = {"friction": "", "drives": "", "bounded": "", "median error": ".1%"}
    columns |= {"within 10 %": ".0%", "interval has it": ".0%"}
    print_table("By layout of the friction", columns, rows)
    stuck = [(one.stuck_time, one.noticed_time) for one in learned]
    delays = sorted(
        noticed - since for since, noticed in stuck if since is not None and noticed is not None
    )
    passed = [one.way_before_notice for one in learned if one.recorded.passed]
    late = ", ".join(f"{delay:.1f}" for delay in delays)
    count = sum(since is not None for since, _ in stuck)
    print(f"stuck: {count}, noticed {len(delays)}, after [s]: {late}")
    ways = ", ".join(f"{1e3 * way:.1f}" for way in passed if way is not None)
    print(f"passed: {len(passed)}, said to be stuck after a way in {BEFORE} s [mm] of: {ways}")


if __name__ == "__main__":
    typer.run(main)
