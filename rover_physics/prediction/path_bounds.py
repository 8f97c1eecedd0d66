"""What an uncertain map leaves open along a path: one frozen record of intervals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.status import BoundStatus


@dataclass(frozen=True, eq=False)
class PathBounds:
    """Bounds along a path of n waypoints: smallest and largest value in the last axis.

    The values and their units are those of `PathPrediction`. NaN where a waypoint has no bounds.
    All arrays are read-only.
    """

    sigmas: float
    """Standard deviations of the map that are allowed for."""
    status: NDArray[np.int8]
    """(n,) a BoundStatus each."""
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
    """(n, 6, 2) [N]; largest infinite where the torques follow the ground (policy "optimal")."""
    friction_utilisation: Floats
    """(n, 6, 2)."""
    torque_saturation: Floats
    """(n, 6, 2)."""
    sinkage: Floats
    """(n, 6, 2) [m]."""

    def __post_init__(self) -> None:
        freeze_fields(self)

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
