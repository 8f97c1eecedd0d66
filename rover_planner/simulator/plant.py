# SPDX-License-Identifier: Apache-2.0
"""The interface of a simulated rover, common to all physics engines."""

from dataclasses import dataclass
from typing import Protocol

from rover_physics.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class PlantState:
    """Measurements of a rover at one time."""

    position: Floats
    """(3,) body origin [m], map frame."""
    orientation: Floats
    """(4,) quaternion x, y, z, w, body to map."""
    velocity: Floats
    """(3,) velocity of the body origin [m/s], body frame."""
    body_rates: Floats
    """(3,) angular velocity [rad/s], body frame."""
    joint_positions: dict[str, float]
    """Angles of suspension, wheels and steered wheels' steering [rad] by joint name."""
    joint_velocities: dict[str, float]
    """Rates of the same joints [rad/s] by joint name."""
    wheel_torques: Floats
    """(6,) torques of the motors [N m], wheel order."""
    stopped: str
    """Reason why the rover does not move as commanded; empty if it moves."""


class Plant(Protocol):
    """A simulated rover that is driven by speeds or torques for given durations."""

    def drive(self, speed: float, yaw_rate: float, duration: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] for a duration [s], with wheel servos.

        Wheels that steer turn at their largest rate, and the rover drives slower or stands until
        they point along the motion.
        """

    def pull(self, torques: Floats, command: tuple[float, float], duration: float) -> None:
        """Apply torques (6,) [N m] for a duration [s].

        `command`, speed [m/s] and yaw rate [rad/s], sets the steering.
        """

    def brake(self, duration: float) -> None:
        """Lock the wheels for a duration [s]; they hold as far as their friction reaches."""

    def state(self) -> PlantState:
        """Return the current measurements."""

    def pose(self) -> Floats:
        """Return x, y [m] and yaw [rad] (3,) of the body origin."""
