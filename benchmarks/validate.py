# SPDX-License-Identifier: Apache-2.0
"""Compares the model with MuJoCo in tables: settled cases, drives, curves (docs/validation.md).

Run from the repository: python -m benchmarks.validate [--energy]

With --energy, which needs the extra `bench`, drives are made anew and their energy is compared.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated

import numpy as np
import typer
from scipy.optimize import linprog

from benchmarks.measure import console, print_table
from rover_physics import (
    PathPrediction,
    Rover,
    SweepOptions,
    Terrain,
    Verdict,
    judge_path,
    judge_poses,
    load_rover,
)
from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES, balance_forces
from rover_physics.prediction.evaluation import new_work, stand
from rover_physics.prediction.packed_model import pack_model
from rover_physics.traversability.verdict import hold_against_limits
from support.reference_cases import DATA, reference_predictions, steered_predictions
from support.reference_drives import KEPT, drive_ground, drive_path, unlimited

PASSED = "passed"
GROUNDS = {"ramp": "slope", "tilt": "cross_slope", "rocks": "caps"}
"""Grounds of drives that curves have, by the name they have there."""
LENGTH, TURN = 2.4, np.pi
"""Length of an arc [m] and angle of a turn on the spot [rad]."""


@dataclass(frozen=True)
class ReferenceDrive:
    """One drive of the rover lsr1 over an obstacle, from x = -1.2 to 1.2 along +x."""

    kind: str
    """step, ditch, bump_one_side, slope or cross_slope."""
    size: float
    """Height or width [m], or angle of a slope [deg]."""
    friction: float
    """Friction coefficient."""
    max_torque: float
    """Torque limit of the speed servos [N m]."""
    outcome: str
    """passed, stuck or tipped; tipped includes sliding off."""
    end: float
    """x at the end of the drive [m]."""

    @property
    def label(self) -> str:
        """Kind and size, such as step 0.163."""
        return (
            f"{self.kind} {self.size:.3f}" if self.size < 1.0 else f"{self.kind} {self.size:.1f}"
        )


def judge_drives(policy: str) -> Iterator[tuple[ReferenceDrive, Verdict]]:
    """Yield every drive with the verdict on its path."""
    rover = unlimited(load_rover("lsr1"))
    for row in json.loads((DATA / "drives.json").read_text())["rows"]:
        drive = ReferenceDrive(
            row["kind"], row["size"], row["mu"], row["tau_max"], row["outcome"], row["x"]
        )
        options = SweepOptions(friction=drive.friction, max_torque=drive.max_torque, policy=policy)
        ground = drive_ground(drive.kind, drive.size)
        prediction = judge_path(rover, ground, drive_path(), options)[0]
        yield drive, hold_against_limits(rover, prediction)


@dataclass(frozen=True, eq=False)
class Curve:
    """One drive of the rover lsr1 along an arc or a turn on the spot."""

    kind: str
    """flat, tilt, ramp, step or rocks."""
    size: float
    """Angle [deg], height [m] or seed."""
    mode: str
    """steered, spot, skid or skid_spot."""
    curvature: float
    """[1/m], infinite on the spot."""
    friction: float
    """Friction coefficient."""
    max_torque: float
    """Torque limit of the speed servos [N m]."""
    start: np.ndarray
    """(3,) x, y [m], yaw [rad]."""
    kept: bool
    """True if it went all the way and ended within KEPT of its nominal end."""
    poses: np.ndarray
    """(k, 3) poses of the trace."""
    forces: np.ndarray
    """(k, 6) size of the force on each wheel, mean since the pose before [N]."""
    torques: np.ndarray
    """(k, 6) mean torque of each wheel since the pose before [N m]."""

    @property
    def label(self) -> str:
        """Ground and mode."""
        return f"{self.kind} {self.size:g} {self.mode} {self.curvature:g}"

    @property
    def steered(self) -> bool:
        """True if the end wheels steer."""
        return self.mode in ("steered", "spot")

    @property
    def ground(self) -> Terrain:
        """The ground."""
        return drive_ground(GROUNDS.get(self.kind, self.kind), self.size)

    @property
    def rover(self) -> Rover:
        """The rover, without limits that MuJoCo lacks."""
        rover = unlimited(load_rover("lsr1"))
        return rover if self.steered else replace(rover, steering=None)

    @property
    def options(self) -> SweepOptions:
        """The options under policy "servo"."""
        return SweepOptions(policy="servo", friction=self.friction, max_torque=self.max_torque)

    @property
    def path(self) -> np.ndarray:
        """Waypoints (241, 3) of the nominal curve."""
        x, y, yaw = self.start
        share = np.linspace(0.0, 1.0, 241)
        if np.isinf(self.curvature):
            return np.column_stack([x + 0.0 * share, y + 0.0 * share, yaw + TURN * share])
        turn = self.curvature * LENGTH * share
        ahead, aside = np.sin(turn) / self.curvature, (1.0 - np.cos(turn)) / self.curvature
        c, s = np.cos(yaw), np.sin(yaw)
        return np.column_stack([x + c * ahead - s * aside, y + s * ahead + c * aside, yaw + turn])

    def predict_trace(self) -> PathPrediction:
        """Return the prediction at the poses of the trace."""
        curvatures = np.full(len(self.poses), self.curvature)
        return judge_poses(self.rover, self.ground, self.poses, curvatures, self.options)[0]


@lru_cache
def read_curves() -> tuple[Curve, ...]:
    """Return all curves."""
    return tuple(_read(row) for row in json.loads((DATA / "curves.json").read_text())["rows"])


def _read(row: dict) -> Curve:
    trace = row["trace"]
    away = np.subtract(row["end"], row["nominal_end"])[:2]
    return Curve(
        kind=row["kind"],
        size=row["size"],
        mode=row["mode"],
        curvature=float(row["kappa"]),
        friction=row["mu"],
        max_torque=row["tau_max"],
        start=np.array(row["start"]),
        kept=row["outcome"] == PASSED and bool(np.hypot(*away) <= KEPT),
        poses=np.array([line["pose"] for line in trace]).reshape(-1, 3),
        forces=np.linalg.norm(
            np.array([line["force"] for line in trace]).reshape(-1, 6, 3), axis=2
        ),
        torques=np.array([line["torque"] for line in trace]).reshape(-1, 6),
    )


def settled_errors(cases) -> dict[str, np.ndarray]:
    """Return absolute errors of settled cases by quantity; the name has the unit."""
    errors: dict[str, list[np.ndarray]] = {}
    weight = load_rover("lsr1").weight
    for case, prediction in cases:
        centres = np.linalg.norm(prediction.wheel_centres - case.wheel_centres, axis=2)
        attitude = np.column_stack([prediction.roll, prediction.pitch]) - case.attitude
        joints = np.hstack([prediction.rocker_angle, prediction.bogie_angle]) - case.joints
        shares = [prediction.wheel_loads, prediction.tangential, prediction.lateral]
        forces = np.sqrt(sum(share**2 for share in shares))
        force_errors = forces - np.linalg.norm(case.forces, axis=2)
        for name, values in (
            ("wheel centres [mm]", 1e3 * centres),
            ("roll and pitch [deg]", np.degrees(attitude)),
            ("suspension angles [deg]", np.degrees(joints)),
            ("wheel forces [% of the weight]", 100.0 * force_errors / weight),
        ):
            errors.setdefault(name, []).append(np.abs(values).ravel())
    return {name: np.concatenate(parts) for name, parts in errors.items()}


def print_settled(name: str, cases) -> None:
    """Print the errors of settled cases."""
    count = sum(len(case.poses) for case, _ in cases)
    settled = sum(int(prediction.settled.sum()) for _, prediction in cases)
    rows = [
        (what, *(f"{v:.3f}" for v in (np.median(e), np.percentile(e, 95), e.max())))
        for what, e in settled_errors(cases).items()
    ]
    headings = ("absolute error of", "median", "95 %", "worst")
    print_table(f"{name}: {settled} of {count} settle", headings, rows)


def print_drives(policy: str) -> None:
    """Print the drives whose outcome differs from the verdict under `policy`."""
    rows, agree, wrongly_passed = [], 0, 0
    for drive, verdict in judge_drives(policy):
        if verdict.traversable == (drive.outcome == PASSED):
            agree += 1
            continue
        wrongly_passed += verdict.traversable
        numbers = f"{drive.friction}", f"{drive.max_torque:.2f}"
        cells = drive.outcome, f"{drive.end:.2f}", verdict.reason or "passable"
        rows.append((drive.label, *numbers, *cells))
    print_table(
        f"Drives under {policy} torques: {agree} of {agree + len(rows)} agree, "
        f"{wrongly_passed} passable that got stuck or tipped",
        ("drive", "mu", "limit [N m]", "in MuJoCo", "ended at x [m]", "verdict"),
        sorted(rows),
    )


def print_curves() -> None:
    """Print the curves whose outcome differs from the verdict under "servo"."""
    rows, agree, wrongly_passed = [], 0, 0
    for curve in read_curves():
        verdict = judge_path(curve.rover, curve.ground, curve.path, curve.options)[1]
        if verdict.traversable == curve.kept:
            agree += 1
            continue
        wrongly_passed += verdict.traversable
        kept = "kept" if curve.kept else "left"
        rows.append((curve.label, f"{curve.friction}", kept, verdict.reason or "passable"))
    print_table(
        f"Curves under servo torques: {agree} of {agree + len(rows)} agree, "
        f"{wrongly_passed} passable that left their path",
        ("curve", "mu", "path in MuJoCo", "verdict"),
        rows,
    )


def print_traces() -> None:
    """Print the median errors of wheel forces and torques along the traces of curves.

    The first pose of a trace is left out: there the rover starts from rest, at its torque limit.
    The scatter is the standard deviation, over the poses of a trace, of a wheel's torque in MuJoCo
    less the model's.
    """
    weight, rows = load_rover("lsr1").weight, []
    for mode in ("steered", "spot", "skid", "skid_spot"):
        forces, torques, scatter = [], [], []
        for curve in read_curves():
            if curve.mode == mode and len(curve.poses):
                found = curve.predict_trace()
                drives = (found.speed_share > 0.0) & (np.arange(len(curve.poses)) > 0)
                parts = (found.wheel_loads, found.tangential, found.lateral)
                errors = np.sqrt(sum(part**2 for part in parts)) - curve.forces
                forces.append(100.0 * np.abs(errors[drives]).ravel() / weight)
                ours, theirs = np.abs([found.torque[drives], curve.torques[drives]]).mean((1, 2))
                torques.append((100.0 * (ours / theirs - 1.0), theirs - ours))
                rest = curve.torques[drives] - found.torque[drives]
                scatter.append(rest.std(axis=0).mean())
        share, missing = np.median(torques, axis=0)
        error = f"{np.median(np.concatenate(forces)):.1f}"
        torque = f"{share:.1f}", f"{missing:.3f}", f"{np.median(scatter):.3f}"
        rows.append((mode, len(forces), error, *torque))
    torque_headings = "mean torque [%]", "missing [N m]", "scatter [N m]"
    headings = ("mode", "curves", "wheel force [% of the weight]", *torque_headings)
    print_table("Along the traces of curves, under servo torques", headings, rows)


def print_bands() -> None:
    """Print the bands in which friction leaves the loads of turned wheels that stand still."""
    rover, bands, loads = load_rover("lsr1"), [], []
    for case, found in steered_predictions():
        model = pack_model(rover, case.terrain, SweepOptions()).record
        for i, pose in enumerate(case.poses):
            work = new_work()
            work.pose[:], work.placement.steering[:] = pose, found.steering_angle[i]
            work.can_follow = True
            stand(model, work)
            columns = 1 + FREE_FORCES
            balance_forces(model.linkage, work.placement, work.contacts, columns, work.balance)
            bands += load_bands(work.balance, rover.friction)
            loads += np.sum(work.balance.frames[:, 0] * case.forces[i], axis=1).tolist()
    low, high = 100.0 * np.array(bands).T
    shares = 100.0 * np.array(loads) / rover.weight
    beyond = np.maximum(low - shares, shares - high)
    inside = f"{100.0 * np.mean(beyond <= 0.1):.0f} % of {len(loads)}"
    row = f"{np.median(high - low):.1f}", f"{np.quantile(high - low, 0.95):.1f}", inside
    headings = "width [% of the weight]", "95 %", "loads in MuJoCo within"
    print_table("Bands of the loads of turned wheels at rest", headings, [row])


def load_bands(balance, friction: float) -> list[tuple[float, float]]:
    """Return the least and largest load of each wheel over the weight, tractions being equal.

    Lateral forces are free as long as they balance and friction holds them.
    """
    free = slice(1 + FREE_TORQUES, 1 + FREE_FORCES)
    N, S = balance.normal, balance.lateral
    rows = [(side * S - friction * N) for side in (1.0, -1.0)] + [-N]
    A, b = np.concatenate(rows)[:, free], -np.concatenate(rows)[:, 0]
    ends = [
        [start + side * linprog(side * change, A, b, bounds=(None, None)).fun for side in (1, -1)]
        for start, change in zip(N[:, 0], N[:, free], strict=True)
    ]
    return [(low, high) for low, high in ends]


def print_energy() -> None:
    """Drive over the obstacles with speed servos, and print the energy with ours.

    MuJoCo's time step is 2 ms: with the usual 4 ms its wheels chatter on their contacts.
    """
    from benchmarks.drives import DROOP, END, OBSTACLES, START, drive, run_in_processes

    x = np.linspace(START, END, round((END - START) / 0.01) + 1)
    path, rows, errors = np.column_stack([x, 0.0 * x, 0.0 * x]), [], []
    jobs = [(obstacle, DROOP, 1, 2.0, 0.002) for obstacle in OBSTACLES]
    for obstacle, row in zip(OBSTACLES, run_in_processes(drive, jobs, None), strict=True):
        if row.passed:
            options = SweepOptions(policy="servo", friction=obstacle.friction)
            rover, ground = unlimited(obstacle.rover), obstacle.ground
            ours = float(judge_path(rover, ground, path, options)[0].energy[-1])
            errors.append(abs(ours / row.energy - 1.0))
            rows.append((obstacle.label, f"{row.energy:.1f}", f"{ours:.1f}"))
    rows.append(("median error", "", f"{np.median(errors):.0%}"))
    title = "Speed servos over 2.4 m at 6 cm/s"
    print_table(title, ("obstacle", "energy in MuJoCo [J]", "of the model [J]"), rows)


def main(
    energy: Annotated[bool, typer.Option("--energy", help="Compare energy, too.")] = False,
) -> None:
    """Print all tables."""
    print_settled("Settled cases", reference_predictions())
    print_settled("Settled with turned wheels", steered_predictions())
    print_bands()
    for policy in ("optimal", "servo", "equal"):
        with console(stderr=True).status(f"drives, {policy}"):
            print_drives(policy)
    print_curves()
    print_traces()
    if energy:
        print_energy()


if __name__ == "__main__":
    typer.run(main)
