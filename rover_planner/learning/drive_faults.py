# SPDX-License-Identifier: Apache-2.0
"""Faults of recorded drives: angles that no rover has, and why nothing can be learned of one."""

import math

import numpy as np

from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.learning.drive_log import (
    HALF_TURN,
    MOTION,
    PITCH,
    ROLL,
    STEERING,
    SUSPENSION,
    TIME,
)
from rover_planner.learning.wheel_slip import LONGEST_GAP, WINDOW, find_block_duration

MOST_SPIKES = 0.1
"""Share of impossible angles up to which they are spikes of a sensor."""
LARGEST = (
    ("roll", ROLL, HALF_TURN),
    ("pitch", PITCH, HALF_TURN - 0.5 * math.pi),
    *((name, SUSPENSION.start + k, HALF_TURN) for k, name in enumerate(SUSPENSION_JOINTS)),
    *((name, STEERING.start + k, HALF_TURN) for k, name in enumerate(STEERING_JOINTS)),
)
"""Angles of a row, their columns, and their largest magnitudes [rad]."""


def check_angles(rows: Floats, source: object) -> None:
    """Check that a drive (n, columns), as in `drive_log`, is in radians; `source` is its name.

    Raises:
        PlanningError: Many of its angles are impossible.
    """
    for name, column, largest in LARGEST:
        values = rows[:, column]
        wrong = np.abs(values) > largest
        if wrong.sum() > MOST_SPIKES * np.isfinite(values).sum():
            at = int(np.argmax(wrong))
            raise PlanningError(
                f"{source}: {name} is {values[at]:g} at {rows[at, TIME]:.13g} s, and beyond "
                f"{largest:.3g} rad in {wrong.mean():.0%} of the rows; angles must be in rad"
            )


def explain_nothing(rows: Floats, rover: Rover) -> str:
    """Return why nothing was learned of the rows of a drive."""
    for column, name in enumerate(MOTION):
        if not np.isfinite(rows[:, column]).any():
            return f"{name} has no value"
    gap = float(np.median(np.diff(rows[:, TIME])))
    if gap > LONGEST_GAP:
        return f"its rows are {gap:g} s apart; they must be {LONGEST_GAP:g} s or less, time in s"
    least, lasts = WINDOW * find_block_duration(rover), float(np.ptp(rows[:, TIME]))
    if lasts < least:
        return f"it lasts {lasts:g} s; it must last {least:g} s or more"
    return "it is not on the known part of the map, or jumps about there"
