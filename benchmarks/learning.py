# SPDX-License-Identifier: Apache-2.0
"""Drives in MuJoCo on ground of unknown friction: what is learned of it, against the truth.

Run from the repository: python -m benchmarks.learning [--drives N] [--seed S] [--keep FOLDER]
It needs the extra `bench`. Drives are drawn at random: ground, friction, control, noise, rate.
"""

import hashlib
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.drives import (
    BY_MOTION,
    DROOP,
    END,
    MAX_OFFSET,
    MAX_TILT,
    PERIOD,
    SERVO,
    SPEED,
    START,
    DriveSteering,
    Obstacle,
    make_controller,
    run_in_processes,
)
from benchmarks.measure import print_table
from rover_physics import Rover, Terrain, load_rover
from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.terrain.grid import save_terrain
from rover_planner.learning.drive_log import (
    PITCH,
    RATES,
    ROLL,
    STEERING,
    SUSPENSION,
    TIME,
    TORQUES,
    WIDTH,
    YAW,
    X,
    Y,
)
from rover_planner.learning.friction_filter import FrictionEstimate
from rover_planner.learning.ground_learner import GroundEstimate, GroundLearner
from rover_planner.learning.wheel_odometry import WheelMotion, WheelOdometry
from rover_planner.simulator.mujoco_rover import MujocoRover
from support.learning_drives import write_csv

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
    "usual": (0.001, 0.01, 0.003, 0.002, 0.03, 0.003),
    "strong": (0.004, 0.03, 0.01, 0.005, 0.10, 0.01),
}
"""Standard deviations: position [m], its drift over the way, attitude and yaw [rad], suspension
[rad], torque [N m], wheel rates [rad/s]."""
STAYED, HALTED, STUCK_FOR = 0.02, 0.1, 4.0
"""A rover that goes no farther than this [m], slower than this share of the commanded speed at
first, in more than this time [s] to the end, is stuck; one that slides along a step is not."""
MOTION_TIME = 0.5
"""Time over which its speed is taken [s]."""


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
        x = np.linspace(ground.bounds[0], ground.bounds[1], ground.elevation.shape[1])
        y = np.linspace(ground.bounds[2], ground.bounds[3], ground.elevation.shape[0])
        first = y[:, None] + 0.0 * x < 0.0 if self.layout == SIDES else x + 0.0 * y[:, None] < 0.0
        return replace(ground, friction=np.where(first, *self.frictions))

    def find_friction(self, places: np.ndarray) -> np.ndarray:
        """Return the friction (n,) at places (n, 2)."""
        if self.layout == CONSTANT:
            return np.full(len(places), self.frictions[0])
        return np.where(places[:, 1 if self.layout == SIDES else 0] < 0.0, *self.frictions)

    def add_noise(self, rows: np.ndarray) -> np.ndarray:
        """Return the rows that are kept, with noise."""
        return add_noise(rows, self.noise, self.seed, self.step)

    @property
    def label(self) -> str:
        """All of it in one line."""
        low, high = self.frictions
        mu = f"{low:.2f}" if self.layout == CONSTANT else f"{low:.2f}|{high:.2f} {self.layout}"
        return (
            f"{self.kind} {self.size:.3g}, {mu}, {self.controller}, {1e3 * self.timestep:.0f} ms, "
            f"{self.noise} noise, {1.0 / (self.step * PERIOD):.0f} Hz"
        )


EXAMPLE = LearningDrive("slope", 24.0, 1, CONSTANT, (0.4, 0.4), SERVO, 0.004, "usual", 1)
"""A drive that ends stuck, for docs/learning.md."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A drive as it was."""

    rows: np.ndarray
    """(n, WIDTH) rows without noise."""
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


def record(drive: LearningDrive, keep: Path | None = None) -> Recorded:
    """Drive in MuJoCo; a folder keeps what was driven."""
    file = None if keep is None else keep / f"{abs(hash_of(drive)):016x}.npz"
    if file is not None and file.exists():
        with np.load(file) as kept:
            return Recorded(kept["rows"], bool(kept["passed"]))
    obstacle = drive.obstacle
    plant = MujocoRover(
        obstacle.rover, drive.ground, (START, 0.0, 0.0), drive.frictions[0], drive.timestep
    )
    steering = DriveSteering(plant, 1)
    control = make_controller(drive.controller, plant, obstacle, steering)
    rows = []
    while plant.time < 1.5 * (END - START) / SPEED and plant.pose[0] < END:
        control()
        if plant.tilt > MAX_TILT or abs(plant.pose[1]) > MAX_OFFSET:
            break
        rows.append(row_of(plant))
    recorded = Recorded(np.array(rows).reshape(-1, WIDTH), bool(plant.pose[0] >= END))
    if file is not None:
        np.savez(file, rows=recorded.rows, passed=recorded.passed)
    return recorded


def hash_of(drive: LearningDrive) -> int:
    """Return a number for what is driven, without the noise and the rate of the log."""
    text = repr(replace(drive, noise="", step=1))
    return int(hashlib.sha256(text.encode()).hexdigest()[:15], 16)


def row_of(plant: MujocoRover) -> np.ndarray:
    """Return what is measured now."""
    row = np.full(WIDTH, np.nan)
    pose, joints = plant.pose, plant.joint_positions
    row[[TIME, X, Y, YAW]] = plant.time, pose[0], pose[1], pose[3]
    row[[ROLL, PITCH]] = plant.attitude
    row[SUSPENSION] = [joints[name] for name in SUSPENSION_JOINTS]
    row[RATES], row[TORQUES] = plant.wheel_rates, plant.wheel_torques
    row[STEERING] = plant.steering_angles
    return row


def add_noise(rows: np.ndarray, noise: str, seed: int, step: int = 1) -> np.ndarray:
    """Return every `step`-th row with noise, a key of NOISE."""
    rows = rows[::step].copy()
    position, drift, attitude, suspension, torque, rate = NOISE[noise]
    rng = np.random.default_rng(seed)
    ways = np.append(0.0, np.hypot(*np.diff(rows[:, [X, Y]], axis=0).T))
    for columns, sigma in (
        ([X, Y], position),
        ([YAW, ROLL, PITCH], attitude),
        (SUSPENSION, suspension),
        (TORQUES, torque),
        (RATES, rate),
    ):
        rows[:, columns] += sigma * rng.standard_normal(rows[:, columns].shape)
    course = rng.uniform(-np.pi, np.pi)
    rows[:, [X, Y]] += drift * np.cumsum(ways)[:, None] * [np.cos(course), np.sin(course)]
    return rows


@dataclass(frozen=True)
class Learned:
    """What was learned of a drive, beside the truth."""

    drive: LearningDrive
    """The drive."""
    estimate: GroundEstimate
    """The estimate at its end."""
    under: np.ndarray
    """(6,) friction under the wheels at its end."""
    early: tuple[float, bool] | None
    """Error of the mean, relative, when slip first bounds it; whether the interval has the truth.
    For constant friction only."""
    stuck_time: float | None
    """When the rover was stuck in truth [s]."""
    passed: bool
    """Whether it reached its end."""
    cost: float
    """CPU time over the time of the drive."""


def learn(drive: LearningDrive, keep: Path | None = None) -> Learned | None:
    """Drive and learn; None where the rover could not stand at the start, or left the map."""
    recorded = record(drive, keep)
    if len(recorded.rows) < 50:
        return None
    rover = told_rover()
    learner = GroundLearner(rover, drive.obstacle.ground)
    learner.commanded = SPEED
    rows = drive.add_noise(recorded.rows)
    early = None
    began = time.process_time()
    for row in rows:
        if learner.take(row) and early is None:
            estimate = learner.estimate
            if estimate.slip_time is not None and estimate.friction.high is not None:
                early = estimate.friction
    cost = (time.process_time() - began) / (rows[-1, TIME] - rows[0, TIME])
    first = None
    if early is not None and drive.layout == CONSTANT:
        mu = drive.frictions[0]
        first = early.mean / mu - 1.0, early.low <= mu <= (early.high or np.inf)
    if learner.window is None:
        return None
    under = drive.find_friction(learner.window.places)
    return Learned(
        drive, learner.estimate, under, first, find_stuck(recorded), recorded.passed, cost
    )


GYRO_NOISE, GYRO_BIAS = 2e-3, 1e-4
"""Noise [rad/sqrt(s)] and standard deviation of the bias [rad/s] of the yaw rate."""


def measure_motion(rows: np.ndarray, truth: np.ndarray, seed: int) -> list[WheelMotion]:
    """Return what wheels and IMU measured in a drive, of rows with noise and without."""
    rng, times = np.random.default_rng(seed), rows[:, TIME]
    noise = GYRO_NOISE / np.sqrt(np.median(np.diff(times))) * rng.standard_normal(len(rows))
    yaw_rates = np.gradient(truth[:, YAW], times) + noise + GYRO_BIAS * rng.standard_normal()
    return [
        WheelMotion(
            row[TIME],
            row[RATES],
            np.nan_to_num(row[STEERING]),
            *row[[ROLL, PITCH]],
            w,
            row[TORQUES],
        )
        for row, w in zip(rows, yaw_rates, strict=True)
    ]


def print_odometry(drives: list[LearningDrive], keep: Path) -> None:
    """Print misses at the ends of drives without visual odometry, after those before with it."""
    rover = told_rover()
    radius, teacher = rover.wheel.radius, WheelOdometry(rover)
    found: dict[str, list[tuple[float, float, float]]] = {}
    for drive in drives:
        recorded = record(drive, keep)
        if not recorded.passed:
            continue
        truth, rows = recorded.rows[:: drive.step], drive.add_noise(recorded.rows)
        motions = measure_motion(rows, truth, drive.seed)
        known, pupil, plain = WheelOdometry(rover), WheelOdometry(rover), np.zeros(2)
        for one in (known, pupil):
            one.forward, one.side = teacher.forward, teacher.side
        for motion in motions:
            before = known.pose[2]
            known.take(motion)
            if motion is not motions[0]:
                yaw = 0.5 * (before + known.pose[2])
                way = radius * motion.rates.mean() * PERIOD * drive.step
                plain += way * np.array([np.cos(yaw), np.sin(yaw)])
        c, s = np.cos(truth[0, YAW]), np.sin(truth[0, YAW])
        end = np.array([[c, s], [-s, c]]) @ (truth[-1] - truth[0])[[X, Y]]
        miss = known.pose[:2] - end
        nees = float(miss @ np.linalg.solve(known.covariance[:2, :2], miss))
        if drive is not drives[0]:
            sizes = float(np.hypot(*miss)), float(np.hypot(*(plain - end)))
            found.setdefault(drive.kind, []).append((*sizes, nees))
        for motion, row in zip(motions, rows, strict=True):
            pupil.take(motion)
            pupil.learn(row[[X, Y, YAW]])
    table = []
    for kind, values in found.items():
        own, plain_miss, nees = np.array(values).T
        table.append(
            (
                kind,
                f"{len(own)}",
                f"{own.mean():.3f}",
                f"{plain_miss.mean():.3f}",
                f"{plain_miss.mean() / own.mean():.1f}",
                f"{nees.mean():.1f}",
                f"{np.mean(nees < 5.99):.0%}",
            )
        )
    headings = "ground", "drives", "miss [m]", "plain [m]", "times better", "NEES", "within 95 %"
    print_table("Wheel odometry at the ends of drives, without visual odometry", headings, table)


def told_rover() -> Rover:
    """Return the rover as the learner knows it."""
    return replace(load_rover("lsr1"), nominal_speed=SPEED)


def find_stuck(recorded: Recorded) -> float | None:
    """Return the time [s] from which a rover stayed to the end, None if it did not."""
    times, places = recorded.rows[:, TIME], recorded.rows[:, [X, Y]]
    away = np.hypot(*(places - places[-1]).T) >= STAYED
    half = round(0.5 * MOTION_TIME / PERIOD)
    before, after = slice(None, -2 * half), slice(2 * half, None)
    speeds = np.hypot(*(places[after] - places[before]).T) / (times[after] - times[before])
    stays = (speeds < HALTED * SPEED) & ~np.logical_or.accumulate(away[::-1])[::-1][half:-half]
    if recorded.passed or not stays.any():
        return None
    since = float(times[half + np.argmax(stays)])
    return since if times[-1] - since > STUCK_FOR else None


def main(
    drives: Annotated[int, typer.Option(help="Number of drives.")] = 60,
    seed: Annotated[int, typer.Option(help="Seed of the drives.")] = 1,
    keep: Annotated[Path | None, typer.Option(help="Folder that keeps the drives.")] = None,
    example: Annotated[
        Path | None, typer.Option(help="Only write drive.csv and terrain.npz of a drive there.")
    ] = None,
) -> None:
    """Learn from drives and print errors, coverage and times."""
    if example is not None:
        example.mkdir(parents=True, exist_ok=True)
        write_csv(example / "drive.csv", EXAMPLE.add_noise(record(EXAMPLE).rows))
        save_terrain(example / "terrain.npz", EXAMPLE.obstacle.ground)
        return
    keep = keep or Path(tempfile.mkdtemp())
    keep.mkdir(parents=True, exist_ok=True)
    jobs = [(draw_drive(seed, number), keep) for number in range(drives)]
    learned = [one for one in run_in_processes(learn, jobs, 2) if one is not None]
    rows = []
    for one in learned:
        friction, sides = one.estimate.friction, one.estimate.sides
        truth = float(np.median(one.under))
        times = one.estimate.slip_time, one.stuck_time, one.estimate.immobilised_time
        high = "-" if friction.high is None else f"{friction.high:.2f}"
        rows.append(
            (
                one.drive.label,
                f"{friction.mean:.2f} [{friction.low:.2f}, {high}]",
                "" if friction.high is None else f"{friction.mean / truth - 1.0:+.0%}",
                "" if is_within(one) else "outside",
                "" if one.early is None else f"{one.early[0]:+.0%}",
                " ".join(f"{s.mean:.2f}" for s in sides.values()),
                *("" if t is None else f"{t:.1f}" for t in times),
                " ".join(one.estimate.faults.values()),
            )
        )
    headings = "drive", "friction", "error", "interval", "early", "right left"
    print_table(
        "What was learned", (*headings, "slip [s]", "stuck [s]", "noticed [s]", "faults"), rows
    )
    print_summary(learned)
    print_odometry([job[0] for job in jobs], keep)


def compare(one: Learned) -> list[tuple[FrictionEstimate, float]]:
    """Return estimates with the friction under most wheels; per side, each with its own."""
    if one.drive.layout == SIDES:
        truths = np.median(one.under.reshape(2, -1), axis=1).tolist()
        return list(zip(one.estimate.sides.values(), truths, strict=True))
    return [(one.estimate.friction, float(np.median(one.under)))]


def is_within(one: Learned) -> bool:
    """Return whether the intervals have the truth."""
    return all(e.low <= mu and (e.high is None or mu <= e.high) for e, mu in compare(one))


def print_summary(learned: list[Learned]) -> None:
    """Print the summary of all drives by layout."""
    rows = []
    for layout in (CONSTANT, SIDES, LINE):
        own = [one for one in learned if one.drive.layout == layout]
        pairs = [pair for one in own for pair in compare(one)]
        errors = [abs(e.mean / mu - 1.0) for e, mu in pairs if e.high is not None]
        rows.append(
            (
                layout,
                f"{len(own)}",
                f"{len(errors)}",
                f"{np.median(errors):.1%}" if errors else "",
                f"{np.mean(np.array(errors) < 0.1):.0%}" if errors else "",
                f"{np.mean([is_within(one) for one in own]):.0%}",
            )
        )
    print_table(
        "By layout of the friction",
        ("friction", "drives", "bounded", "median error", "within 10 %", "interval has it"),
        rows,
    )
    first = [one.early for one in learned if one.early is not None]
    print(
        f"constant, when slip first bounds it: {np.median([abs(e[0]) for e in first]):.0%} off, "
        f"within 10 % in {np.mean([abs(e[0]) < 0.1 for e in first]):.0%}, "
        f"interval has it in {np.mean([e[1] for e in first]):.0%} of {len(first)}"
    )
    stuck = [one for one in learned if one.stuck_time is not None]
    noticed = [one.estimate.immobilised_time for one in stuck]
    delays = sorted(
        t - one.stuck_time
        for t, one in zip(noticed, stuck, strict=True)
        if t is not None and one.stuck_time is not None
    )
    false = [one for one in learned if one.passed and one.estimate.immobilised_time is not None]
    late = ", ".join(f"{delay:.1f}" for delay in delays)
    print(f"stuck: {len(stuck)}, noticed {len(delays)}, after [s]: {late}")
    print(f"passed: {sum(one.passed for one in learned)}, said to be stuck: {len(false)}")
    print(f"CPU: {100 * np.median([one.cost for one in learned]):.1f} % of a core")


if __name__ == "__main__":
    typer.run(main)
