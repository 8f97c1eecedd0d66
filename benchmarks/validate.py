# SPDX-License-Identifier: Apache-2.0
"""Compares the model with MuJoCo in tables: settled cases, drives, curves (docs/validation.md).

Run from the repository: python -m benchmarks.validate [--energy]

With --energy, which needs the extra `bench`, drives are made anew and their energy is compared.
"""

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated

import numpy as np
import typer
from scipy.optimize import linprog

from benchmarks.grounds import Obstacle
from benchmarks.measure import console, print_table
from rover_physics import (
    PathPrediction,
    Rover,
    SweepOptions,
    Verdict,
    judge_path,
    judge_poses,
    load_rover,
)
from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES, balance_forces
from rover_physics.prediction.evaluation import new_work, stand
from rover_physics.prediction.packed_model import pack_model
from rover_physics.traversability.verdict import hold_against_limits
from support.paths import arc_of, poses_at
from support.reference_cases import DATA, STEERED, reference_predictions
from support.reference_drives import KEPT, drive_path, unlimited

PASSED = "passed"
GROUNDS = {"ramp": "slope", "tilt": "cross_slope", "rocks": "caps"}
"""Kinds of grounds, by the name that curves have for them."""
DRIVES = {"drive": "", "mu": "", "limit [N m]": ".2f", "in MuJoCo": "", "ended at x [m]": ".2f"}
CURVES = {"curve": "", "mu": "", "path in MuJoCo": ""}
"""Columns of tables beside the verdict."""
LENGTH, TURN = 2.4, np.pi
"""Length of an arc [m] and angle of a turn on the spot [rad]."""


@dataclass(frozen=True, kw_only=True)
class ReferenceDrive(Obstacle):
    """One drive of the rover lsr1 over an obstacle, from x = -1.2 to 1.2 along +x."""

    outcome: str
    """passed, stuck or tipped; tipped includes sliding off."""
    end: float
    """x at the end of the drive [m]."""

    @property
    def kept(self) -> bool:
        """True if it passed."""
        return self.outcome == PASSED

    @property
    def cells(self) -> tuple[str | float, ...]:
        """What DRIVES says of it; kind and size are such as step 0.163."""
        label = f"{self.kind} {self.size:.{3 if self.size < 1.0 else 1}f}"
        return label, self.friction, self.max_torque, self.outcome, self.end


def judge_drives(policy: str) -> Iterator[tuple[ReferenceDrive, Verdict]]:
    """Yield every drive with the verdict on its path."""
    rover = unlimited(load_rover("lsr1"))
    for row in json.loads((DATA / "drives.json").read_text())["rows"]:
        drive = ReferenceDrive(
            kind=row["kind"],
            size=row["size"],
            friction=row["mu"],
            max_torque=row["tau_max"],
            outcome=row["outcome"],
            end=row["x"],
        )
        prediction = judge_path(rover, drive.ground, drive_path(), drive.options(policy))[0]
        yield drive, hold_against_limits(rover, prediction)


@dataclass(frozen=True, eq=False, kw_only=True)
class Curve(Obstacle):
    """One drive of the rover lsr1 along an arc or a turn on the spot."""

    mode: str
    """steered, spot, skid or skid_spot."""
    curvature: float
    """[1/m], infinite on the spot."""
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
    def cells(self) -> tuple[str | float, ...]:
        """What CURVES says of it."""
        label = f"{self.kind} {self.size:g} {self.mode} {self.curvature:g}"
        return label, self.friction, "kept" if self.kept else "left"

    @property
    def rover(self) -> Rover:
        """The rover, without limits that MuJoCo lacks."""
        rover = unlimited(load_rover("lsr1"))
        return replace(rover, steering=None) if "skid" in self.mode else rover

    @property
    def path(self) -> np.ndarray:
        """Waypoints (241, 3) of the nominal curve."""
        x, y, yaw = self.start
        share = np.linspace(0.0, 1.0, 241)
        if np.isinf(self.curvature):
            return poses_at(x, y, yaw + TURN * share)
        return arc_of(self.curvature, LENGTH * share, yaw) + poses_at(x, y)

    def predict_trace(self) -> PathPrediction:
        """Return the prediction at the poses of the trace."""
        curvatures, options = np.full(len(self.poses), self.curvature), self.options("servo")
        return judge_poses(self.rover, self.ground, self.poses, curvatures, options)[0]


@lru_cache
def read_curves() -> tuple[Curve, ...]:
    """Return all curves."""
    return tuple(_read(row) for row in json.loads((DATA / "curves.json").read_text())["rows"])


def _read(row: dict) -> Curve:
    trace = row["trace"]
    away = np.subtract(row["end"], row["nominal_end"])[:2]
    return Curve(
        kind=GROUNDS.get(row["kind"], row["kind"]),
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
    errors = defaultdict[str, list[np.ndarray]](list)
    weight = load_rover("lsr1").weight
    for case, prediction in cases:
        centres = np.linalg.norm(prediction.wheel_centres - case.wheel_centres, axis=2)
        joints = np.hstack([prediction.rocker_angle, prediction.bogie_angle]) - case.joints
        forces = size_of_forces(prediction) - np.linalg.norm(case.forces, axis=2)
        errors["wheel centres [mm]"].append(1e3 * centres)
        errors["suspension angles [deg]"].append(np.degrees(joints))
        errors["wheel forces [% of the weight]"].append(100.0 * forces / weight)
    return {name: np.abs(np.concatenate(parts)).ravel() for name, parts in errors.items()}


def size_of_forces(prediction: PathPrediction) -> np.ndarray:
    """Return the sizes (n, 6) of the forces on the wheels [N]."""
    parts = [prediction.wheel_loads, prediction.tangential, prediction.lateral]
    return np.linalg.norm(parts, axis=0)


def print_settled(name: str, cases) -> None:
    """Print the errors of settled cases."""
    count = sum(len(case.poses) for case, _ in cases)
    settled = sum(int(prediction.settled.sum()) for _, prediction in cases)
    rows = [
        (what, np.median(error), np.percentile(error, 95), error.max())
        for what, error in settled_errors(cases).items()
    ]
    columns = {"absolute error of": "", "median": ".3f", "95 %": ".3f", "worst": ".3f"}
    print_table(f"{name}: {settled} of {count} settle", columns, rows)


def print_differences(
    title: str, columns: dict[str, str], judged: Sequence[tuple[ReferenceDrive | Curve, Verdict]]
) -> None:
    """Print the drives whose outcome differs from the verdict on their path."""
    wrong = [(drive, verdict) for drive, verdict in judged if drive.kept != verdict.traversable]
    agree, passable = len(judged) - len(wrong), sum(verdict.traversable for _, verdict in wrong)
    print_table(
        f"{title}: {agree} of {len(judged)} agree, {passable} passable that failed",
        columns | {"verdict": ""},
        sorted((*drive.cells, verdict.reason or "passable") for drive, verdict in wrong),
    )


def print_traces() -> None:
    """Print the median errors of wheel forces and torques along the traces of curves.

    The first pose of a trace is left out: there the rover starts from rest, at its torque limit.
    The scatter is the standard deviation, over the poses of a trace, of a wheel's torque in MuJoCo
    less the model's.
    """
    weight, rows = load_rover("lsr1").weight, []
    for mode in ("steered", "spot", "skid", "skid_spot"):
        forces, torques = [], []
        for curve in read_curves():
            if curve.mode == mode and len(curve.poses):
                found = curve.predict_trace()
                drives = (found.speed_share > 0.0) & (np.arange(len(curve.poses)) > 0)
                errors = np.abs(size_of_forces(found) - curve.forces)[drives]
                forces.append(100.0 * errors.ravel() / weight)
                ours, theirs = np.abs([found.torque[drives], curve.torques[drives]]).mean((1, 2))
                rest = curve.torques[drives] - found.torque[drives]
                scatter = rest.std(axis=0).mean()
                torques.append((100.0 * (ours / theirs - 1.0), theirs - ours, scatter))
        force = np.median(np.concatenate(forces))
        rows.append((mode, len(forces), force, *np.median(torques, axis=0)))
    columns = {"mode": "", "curves": "", "wheel force [% of the weight]": ".1f"}
    columns |= {"mean torque [%]": ".1f", "missing [N m]": ".3f", "scatter [N m]": ".3f"}
    print_table("Along the traces of curves, under servo torques", columns, rows)


def print_bands() -> None:
    """Print the bands in which friction leaves the loads of turned wheels that stand still."""
    rover, bands, loads = load_rover("lsr1"), [], []
    for case, found in reference_predictions(STEERED):
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
    columns = {"width [% of the weight]": ".1f", "95 %": ".1f", "loads in MuJoCo within": ""}
    row = np.median(high - low), np.quantile(high - low, 0.95), inside
    print_table("Bands of the loads of turned wheels at rest", columns, [row])


def load_bands(balance, friction: float) -> Iterator[tuple[float, float]]:
    """Yield the least and largest load of each wheel over the weight, tractions being equal.

    Lateral forces are free as long as they balance and friction holds them.
    """
    free = slice(1 + FREE_TORQUES, 1 + FREE_FORCES)
    N, S = balance.normal, balance.lateral
    rows = [(side * S - friction * N) for side in (1.0, -1.0)] + [-N]
    A, b = np.concatenate(rows)[:, free], -np.concatenate(rows)[:, 0]
    for start, change in zip(N[:, 0], N[:, free], strict=True):
        programs = (linprog(side * change, A, b, bounds=(None, None)) for side in (1, -1))
        least, most = (one.fun for one in programs)
        yield start + least, start - most


def print_energy() -> None:
    """Drive over the obstacles with speed servos, and print the energy with ours.

    MuJoCo's time step is 2 ms: with the usual 4 ms its wheels chatter on their contacts.
    """
    from benchmarks.drives import DROOP, OBSTACLES, drive, rover_of, run_in_processes

    errors, rows = [], []
    jobs = [(obstacle, DROOP, 1, 2.0, 0.002) for obstacle in OBSTACLES]
    for obstacle, row in zip(OBSTACLES, run_in_processes(drive, jobs), strict=True):
        if row.passed:
            asked = unlimited(rover_of(obstacle)), obstacle.ground, drive_path()
            ours = float(judge_path(*asked, obstacle.options("servo"))[0].energy[-1])
            errors.append(abs(ours / row.energy - 1.0))
            rows.append((obstacle.label, row.energy, ours))
    rows.append(("median error", None, f"{np.median(errors):.0%}"))
    columns = {"obstacle": "", "energy in MuJoCo [J]": ".1f", "of the model [J]": ".1f"}
    print_table("Speed servos over 2.4 m at 6 cm/s", columns, rows)


def main(
    energy: Annotated[bool, typer.Option("--energy", help="Compare energy, too.")] = False,
) -> None:
    """Print all tables."""
    print_settled("Settled cases", reference_predictions())
    print_settled("Settled with turned wheels", reference_predictions(STEERED))
    print_bands()
    for policy in ("optimal", "servo", "equal"):
        with console(stderr=True).status(f"drives, {policy}"):
            print_differences(f"Drives under {policy} torques", DRIVES, [*judge_drives(policy)])
    curves = [
        (curve, judge_path(curve.rover, curve.ground, curve.path, curve.options("servo"))[1])
        for curve in read_curves()
    ]
    print_differences("Curves under servo torques", CURVES, curves)
    print_traces()
    if energy:
        print_energy()


if __name__ == "__main__":
    typer.run(main)
