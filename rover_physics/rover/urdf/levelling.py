# SPDX-License-Identifier: Apache-2.0
"""Brings the wheels of a robot onto level ground: by its pitch and the angle of its bogies."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.numerics.arrays import Floats

LEVEL = 1e-6
"""Height difference of wheels that counts as none [m]."""
MAX_ANGLE = 0.1
"""Largest pitch or bogie angle that is made up for [rad]."""
STEP = 1e-6
"""Step of the differences that replace derivatives [rad]."""
ROUNDS = 20


@dataclass(frozen=True)
class Levelling:
    """How the axes and the bogies of a URDF stand on level ground."""

    pitch: float = 0.0
    """Pitch of the axes of the URDF [rad], positive nose down; that of the body frame is 0."""
    bogie: float = 0.0
    """Angle of both bogies about y, beyond that of the map [rad]."""


def level_wheels(heights: Callable[[Levelling], Sequence[float]]) -> Levelling:
    """Find the pitch and the bogie angle at which all wheels are level.

    Args:
        heights: Returns the heights of rear, middle and front wheels [m], means of both sides.

    Returns:
        No angles where the wheels are level as the URDF has them.

    Raises:
        RoverFileError: There are none within MAX_ANGLE.
    """
    angles = np.zeros(2)
    for _ in range(ROUNDS):
        off = _differences(heights, angles)
        if np.abs(off).max() <= LEVEL * 1e-3:
            break
        if not angles.any() and np.abs(off).max() <= LEVEL:
            return Levelling()
        slopes = [(_differences(heights, angles + step) - off) / STEP for step in STEP * np.eye(2)]
        matrix = np.column_stack(slopes)
        if abs(np.linalg.det(matrix)) < 1e-12:
            break
        angles = angles - np.linalg.solve(matrix, off)
        if np.abs(angles).max() > MAX_ANGLE:
            break
    if np.abs(angles).max() > MAX_ANGLE or np.abs(_differences(heights, angles)).max() > LEVEL:
        rear, middle, front = (float(height) for height in heights(Levelling()))
        raise RoverFileError(
            f"wheels at angle 0 are not level: rear {rear:.4g}, middle {middle:.4g}, front "
            f"{front:.4g} m; give the angles of joints on flat ground, or correct axes"
        )
    return Levelling(*angles.tolist())


def _differences(heights: Callable[[Levelling], Sequence[float]], angles: Floats) -> Floats:
    """Return heights of middle and front wheels over that of the rear ones (2,) [m]."""
    rear, middle, front = heights(Levelling(*angles.tolist()))
    return np.array([middle - rear, front - rear])
