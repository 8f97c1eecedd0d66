"""What a simulated rover is to the node around it, whichever engine moves it."""

from dataclasses import dataclass
from typing import Protocol

from rover_physics.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class PlantState:
    """What can be measured of a rover at one moment."""

    position: Floats
    """(3,) body origin [m], map frame."""
    orientation: Floats
    """(4,) quaternion x, y, z, w, body to map."""
    velocity: Floats
    """(3,) of the body origin [m/s], body frame."""
    body_rates: Floats
    """(3,) angular velocity [rad/s], body frame."""
    joint_positions: dict[str, float]
    """Angles of suspension and wheels [rad] by joint name."""
    joint_velocities: dict[str, float]
    """Rates of the same [rad/s]."""
    wheel_torques: Floats
    """(6,) torques of the motors [N m], wheel order."""
    stopped: str
    """Why the rover does not go on though it should, empty where it does."""


class Plant(Protocol):
    """A rover that is told speeds, or torques, and moves on by a time."""

    def drive(self, speed: float, yaw_rate: float, duration: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] for a time [s], by the wheels' servos."""

    def pull(self, torques: Floats, yaw_rate: float, duration: float) -> None:
        """Let torques (6,) [N m] act for a time [s]; `yaw_rate` is what steering asks for."""

    def state(self) -> PlantState:
        """Return what can be measured now."""

    def pose(self) -> Floats:
        """Return x, y [m] and yaw [rad] (3,) of the body origin."""
