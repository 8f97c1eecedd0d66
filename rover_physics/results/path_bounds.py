# SPDX-License-Identifier: Apache-2.0
"""Bounds on the prediction along a path over a map with uncertain heights."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.numerics.records import record_type
from rover_physics.status import BoundStatus

BOUNDS = record_type(
    ("status", np.int8),  # a BoundStatus
    ("roll", float, (2,)),  # [rad]
    ("pitch", float, (2,)),  # [rad]
    ("rocker_angle", float, (2, 2)),  # right and left [rad]
    ("bogie_angle", float, (2, 2)),  # right and left [rad]
    ("belly_clearance", float, (2,)),  # [m]
    ("tip_over_ratio", float, (2,)),
    ("wheel_loads", float, (6, 2)),  # [N]; the largest is infinite under policy "optimal"
    ("friction_utilisation", float, (6, 2)),
    ("torque_saturation", float, (6, 2)),
    ("sinkage", float, (6, 2)),  # [m]
)
"""Smallest and largest value at one pose, of quantities as in `PathPrediction`.

The torques of policy "optimal" follow the ground, so that a load has no upper bound.
"""
BOUNDED_VALUES = tuple(name for name in BOUNDS.names or () if name != "status")
"""Names of the bounded values."""


@dataclass(frozen=True, eq=False)
class PathBounds:
    """Bounds at n waypoints: its attributes are the arrays (n, ..., 2) of BOUNDS, and more.

    The last axis holds smallest and largest value. A waypoint without bounds has NaN. All arrays
    are read-only.
    """

    sigmas: float
    """Number of standard deviations by which the map's heights may be wrong."""
    values: Any
    """(n,) BOUNDS of each waypoint."""

    def __post_init__(self) -> None:
        freeze_fields(self)

    def __getattr__(self, name: str) -> Any:
        if name in (BOUNDS.names or ()):
            return self.values[name]
        raise AttributeError(f"a PathBounds has no {name!r}; it has {', '.join(BOUNDED_VALUES)}")

    def cut(self, waypoints: int) -> "PathBounds":
        """Return the bounds on the first waypoints."""
        return replace(self, values=self.values[:waypoints])

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
