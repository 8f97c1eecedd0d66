"""Compares the model with MuJoCo in tables: settled cases, drives, curves (docs/validation.md).

Run from the repository: python -m benchmarks.validate
"""

import numpy as np
from rich.console import Console
from rich.table import Table

from rover_physics.prediction.sweep import sweep_path
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.verdict import hold_against_limits
from support.reference_cases import reference_predictions, steered_predictions
from support.reference_drives import (
    PASSED,
    Drive,
    curve_ground,
    curve_options,
    curve_path,
    curve_rover,
    judge_drives,
    predict_trace,
    read_curves,
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


def settled_table(name: str, cases) -> Table:
    """Return the errors of settled cases as a table."""
    count = sum(len(case.poses) for case, _ in cases)
    settled = sum(int(prediction.settled.sum()) for _, prediction in cases)
    table = Table(title=f"{name}: {settled} of {count} settle")
    table.add_column("absolute error of")
    for heading in ("median", "95 %", "worst"):
        table.add_column(heading, justify="right")
    for name, values in settled_errors(cases).items():
        found = np.median(values), np.percentile(values, 95), values.max()
        table.add_row(name, *(f"{value:.3f}" for value in found))
    return table


def drives_table(policy: str) -> Table:
    """Return a table of the drives whose outcome differs from the verdict under `policy`."""
    rows, agree, wrongly_passed = [], 0, 0
    for drive, _, verdict in judge_drives(policy):
        if verdict.traversable == (drive.outcome == PASSED):
            agree += 1
        else:
            wrongly_passed += verdict.traversable
            rows.append((*_describe(drive), verdict.reason or "passable"))
    table = Table(
        title=f"Drives under {policy} torques: {agree} of {agree + len(rows)} agree, "
        f"{wrongly_passed} passable that got stuck or tipped"
    )
    for heading in ("drive", "mu", "limit [N m]", "in MuJoCo", "ended at x [m]", "verdict"):
        table.add_column(heading)
    for row in sorted(rows):
        table.add_row(*row)
    return table


def curves_table() -> Table:
    """Return a table of the curves whose outcome differs from the verdict under "servo"."""
    rows, agree, wrongly_passed = [], 0, 0
    for curve in read_curves():
        rover, ground = curve_rover(curve), curve_ground(curve.kind, curve.size)
        verdict = judge(rover, sweep_path(rover, ground, curve_path(curve), curve_options(curve)))
        if verdict.traversable == curve.kept:
            agree += 1
        else:
            wrongly_passed += verdict.traversable
            kept = "kept" if curve.kept else "left"
            rows.append((curve.label, f"{curve.friction}", kept, verdict.reason or "passable"))
    table = Table(
        title=f"Curves under servo torques: {agree} of {agree + len(rows)} agree, "
        f"{wrongly_passed} passable that left their path"
    )
    for heading in ("curve", "mu", "path in MuJoCo", "verdict"):
        table.add_column(heading)
    for row in rows:
        table.add_row(*row)
    return table


def traces_table() -> Table:
    """Return the median errors of wheel forces and mean torques along the traces of curves."""
    table = Table(title="Along the traces of curves, under servo torques")
    for heading in ("mode", "curves", "wheel force [% of the weight]", "mean torque [%]"):
        table.add_column(heading)
    weight = load_rover("lsr1").weight
    for mode in ("steered", "spot", "skid", "skid_spot"):
        forces, torques = [], []
        for curve in read_curves():
            if curve.mode == mode and len(curve.poses):
                found = predict_trace(curve)
                drives = found.speed_share > 0.0
                parts = (found.wheel_loads, found.tangential, found.lateral)
                errors = np.sqrt(sum(part**2 for part in parts)) - curve.forces
                forces.append(100.0 * np.abs(errors[drives]).ravel() / weight)
                ours, theirs = np.abs([found.torque[drives], curve.torques[drives]]).mean((1, 2))
                torques.append(100.0 * (ours / theirs - 1.0))
        values = np.median(np.concatenate(forces)), np.median(torques)
        table.add_row(mode, f"{len(forces)}", *(f"{value:.1f}" for value in values))
    return table


def _describe(drive: Drive) -> tuple[str, ...]:
    numbers = f"{drive.friction}", f"{drive.max_torque:.2f}"
    return drive.label, *numbers, drive.outcome, f"{drive.end:.2f}"


def main() -> None:
    """Print all tables."""
    console = Console()
    console.print(settled_table("Settled cases", reference_predictions()))
    console.print(settled_table("Settled with turned wheels", steered_predictions()))
    for policy in ("optimal", "servo", "equal"):
        with console.status(f"drives, {policy}"):
            table = drives_table(policy)
        console.print(table)
    console.print(curves_table())
    console.print(traces_table())


if __name__ == "__main__":
    main()
