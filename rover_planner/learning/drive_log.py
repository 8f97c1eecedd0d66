# SPDX-License-Identifier: Apache-2.0
"""A recorded drive as rows of measurements, and its CSV file."""

import csv
from pathlib import Path

import numpy as np

from rover_physics.files.validation import show_file
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_planner.errors import PlanningError

TIME, X, Y, YAW, ROLL, PITCH = range(6)
"""Columns of a row: time [s], position [m], yaw, roll and pitch [rad], map frame."""
SUSPENSION, RATES, TORQUES, STEERING, FORCES = (
    slice(6, 10), slice(10, 16), slice(16, 22), slice(22, 28), slice(28, 46),
)  # fmt: skip
"""Columns of suspension angles [rad], wheel rates [rad/s], wheel torques [N m], steering angles
[rad], and forces of the ground on the wheels as sensors feel them [N], forward, left and up in the
frame of the wheel's link; each in the order of all arrays."""
WIDTH = 46
"""Number of columns of a row."""
MOTION = ("time", "x", "y", "yaw", "roll", "pitch", *SUSPENSION_JOINTS)
"""Names of the columns that a CSV file must have, beside rates and torques or currents."""
HALF_TURN = 3.15
"""Largest magnitude of an angle of a rover or its joints [rad], with what files round."""
MAX_ROWS = 5_000_000
"""Largest number of rows of a file."""


def read_csv(path: Path, current_constant: float | None) -> Floats:
    """Read a drive from a CSV file; return rows (n, WIDTH), NaN where nothing was measured.

    Args:
        path: The file. Columns are found by name and others are ignored: `MOTION`,
            `<wheel>_wheel_rate`, `<wheel>_wheel_torque` or `<wheel>_wheel_current`, and where
            there are such columns `<wheel>_steering`, and `<wheel>_fx`, `_fy`, `_fz` of force
            sensors. SI units, map frame; a field is empty where nothing was measured.
        current_constant: Torque over motor current [N m/A], for files with currents.

    Raises:
        PlanningError: The file cannot be read, lacks a column, has one twice or a field that is no
            number; times do not increase, or currents have no constant.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            header = [name.strip() for name in next(reader, [])]
            places = _find_columns(header, show_file(path), current_constant)
            rows = [_read_row(fields, places, reader.line_num) for fields in reader if fields]
    except (OSError, UnicodeError, csv.Error) as error:
        raise PlanningError(f"{show_file(path)}: cannot be read: {error}") from None
    except ValueError as error:
        raise PlanningError(f"{show_file(path)}: {error}") from None
    return check_rows(np.array(rows).reshape(-1, WIDTH), str(show_file(path)))


def check_rows(rows: Floats, source: str) -> Floats:
    """Return rows in the order of time, with a continuous yaw, without those that have no time.

    Raises:
        PlanningError: Fewer than two rows, too many, or times that go back.
    """
    rows = rows[np.isfinite(rows[:, TIME])]
    if not 2 <= len(rows) <= MAX_ROWS:
        raise PlanningError(
            f"{source}: has {len(rows)} rows with a time; a drive has 2 to {MAX_ROWS}"
        )
    steps = np.diff(rows[:, TIME])
    if (steps < 0.0).any():
        at = int(np.argmin(steps >= 0.0))
        raise PlanningError(f"{source}: time goes back after {rows[at, TIME]:.13g} s")
    rows = rows[np.append(True, steps > 0.0)]
    known = np.isfinite(rows[:, YAW])
    rows[known, YAW] = np.unwrap(rows[known, YAW])
    return rows


def _find_columns(
    header: list[str], source: object, current_constant: float | None
) -> list[tuple[int, int, float]]:
    """Return pairs of columns, file's and row's, and the factor between them."""
    currents = [f"{name}_current" for name in WHEEL_JOINTS]
    torques = [f"{name}_torque" for name in WHEEL_JOINTS]
    rates = [f"{name}_rate" for name in WHEEL_JOINTS]
    by_current = set(currents) <= set(header) and not set(torques) & set(header)
    if by_current and current_constant is None:
        raise PlanningError(
            f"{source}: has motor currents; the rover file needs wheel.torque_per_current in N m/A"
        )
    needed = [*MOTION, *rates, *(currents if by_current else torques)]
    lacking = [name for name in needed if name not in header]
    if lacking:
        raise PlanningError(
            f"{source}: has no column {lacking[0]}; needed are {', '.join(MOTION)}, "
            "<wheel>_wheel_rate and <wheel>_wheel_torque or <wheel>_wheel_current"
        )
    twice = {name for name in header if name and header.count(name) > 1}
    wanted = [(name, k, 1.0) for k, name in enumerate([*MOTION, *rates])]
    factor = current_constant if by_current and current_constant is not None else 1.0
    wanted += [(name, TORQUES.start + k, factor) for k, name in enumerate(needed[-6:])]
    wanted += [(name, STEERING.start + k, 1.0) for k, name in enumerate(STEERING_JOINTS)]
    felt = [f"{name}_f{axis}" for name in WHEELS for axis in "xyz"]
    wanted += [(name, FORCES.start + k, 1.0) for k, name in enumerate(felt)]
    for name, _, _ in wanted:
        if name in twice:
            raise PlanningError(f"{source}: has two columns {name}; it must be one")
    return [(header.index(name), to, factor) for name, to, factor in wanted if name in header]


def _read_row(fields: list[str], places: list[tuple[int, int, float]], line: int) -> list[float]:
    row = [np.nan] * WIDTH
    for column, to, factor in places:
        text = fields[column].strip() if column < len(fields) else ""
        if text:
            try:
                row[to] = factor * float(text)
            except ValueError:
                raise ValueError(f"line {line} has {text!r}; it must be a number") from None
    return [value if np.isfinite(value) else np.nan for value in row]
