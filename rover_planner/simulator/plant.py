# SPDX-License-Identifier: Apache-2.0
"""What is measured of a simulated rover, whatever simulates it."""

from dataclasses import dataclass

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
