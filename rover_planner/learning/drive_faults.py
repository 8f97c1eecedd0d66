# SPDX-License-Identifier: Apache-2.0
"""Faults of recorded drives: angles that no rover has, and why nothing can be learned of one."""

import math

import numpy as np

from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.learning.drive_log import (
    MOTION,
    PITCH,
    ROLL,
    STEERING,
    SUSPENSION,
    TIME,
)
from rover_planner.learning.wheel_slip import LONGEST_GAP, WINDOW, find_block_duration
from rover_planner.traction.limits import MeasurementLimits

ROUNDING = 0.01
"""Angle by which a file may round half a turn or a quarter [rad]."""


def check_angles(rows: Floats, rover: Rover, source: object) -> None:
    """Check that a rover may have the angles of a drive; in degrees most drives have others.

    Args:
        rows: As in `drive_log`.
        rover: The rover.
        source: Name of the drive.

    Raises:
        PlanningError: An angle that no rover of this kind has.
    """
    joints = MeasurementLimits(rover).angles
    half, quarter = math.pi + ROUNDING, 0.5 * math.pi + ROUNDING
    columns = [("roll", ROLL, (-half, half)), ("pitch", PITCH, (-quarter, quarter))]
    for names, first in ((SUSPENSION_JOINTS, SUSPENSION.start), (STEERING_JOINTS, STEERING.start)):
        columns += [(n, first + k, joints[n]) for k, n in enumerate(names) if n in joints]
    for name, column, (low, high) in columns:
        values = rows[:, column]
        wrong = np.flatnonzero((values < low) | (values > high))
        if len(wrong):
            at = rows[wrong[0], TIME]
            raise PlanningError(
                f"{source}: {name} is {values[wrong[0]]:g} at {at:g} s; it must be in "
                f"{low:.3g} to {high:.3g} rad"
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
