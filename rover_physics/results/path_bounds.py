# SPDX-License-Identifier: Apache-2.0
"""Bounds on a prediction along a path over an uncertain map: one frozen record of intervals."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.status import BoundStatus


@dataclass(frozen=True, eq=False)
class PathBounds:
    """Bounds along a path of n waypoints; the last axis holds smallest and largest value.

    Quantities and units are those of `PathPrediction`. A waypoint without bounds has NaN. All
    arrays are read-only.
    """

    sigmas: float
    """Number of standard deviations by which the map's heights may be wrong."""
    status: NDArray[np.int8]
    """(n,) BoundStatus of each waypoint."""
    roll: Floats
    """(n, 2) [rad]."""
    pitch: Floats
    """(n, 2) [rad]."""
    rocker_angle: Floats
    """(n, 2, 2) [rad]."""
    bogie_angle: Floats
    """(n, 2, 2) [rad]."""
    belly_clearance: Floats
    """(n, 2) [m]."""
    tip_over_ratio: Floats
    """(n, 2)."""
    wheel_loads: Floats
    """(n, 6, 2) [N]; the largest is infinite under policy "optimal", whose torques follow the
    ground."""
    friction_utilisation: Floats
    """(n, 6, 2)."""
    torque_saturation: Floats
    """(n, 6, 2)."""
    sinkage: Floats
    """(n, 6, 2) [m]."""

    def __post_init__(self) -> None:
        freeze_fields(self)

    def cut(self, waypoints: int) -> "PathBounds":
        """Return the bounds on the first waypoints."""
        first: dict[str, Any] = {
            name: value[:waypoints]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        return replace(self, **first)

    @property
    def bounded(self) -> NDArray[np.bool_]:
        """(n,) True for the waypoints that have bounds."""
        return np.asarray(self.status == BoundStatus.BOUNDED)

    @property
    def tilt(self) -> Floats:
        """(n, 2) smallest and largest angle between the body's z axis and the vertical [rad]."""
        roll, pitch = _sizes(self.roll), _sizes(self.pitch)
        return np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))


def _sizes(angles: Floats) -> Floats:
    """Return the smallest and largest absolute value (n, 2) within intervals (n, 2)."""
    sizes = np.sort(np.abs(angles), axis=1)
    sizes[angles[:, 0] * angles[:, 1] < 0.0, 0] = 0.0
    return sizes
