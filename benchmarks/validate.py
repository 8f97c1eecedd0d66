"""Compares the model with MuJoCo in tables: settled cases and drives (docs/validation.md).

Run from the repository: python -m benchmarks.validate
"""

import numpy as np
from rich.console import Console
from rich.table import Table

from rover_physics.rover.rover_file import load_rover
from support.reference_cases import reference_predictions, steered_predictions
from support.reference_drives import PASSED, Drive, judge_drives


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


if __name__ == "__main__":
    main()
