"""What may be chosen when the model is asked: policy, friction, torque, soil, arm, direction."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import EQUAL, OPTIMAL
from rover_physics.rover.manipulator import as_vector
from rover_physics.status import TorquePolicy

POLICIES = {EQUAL: TorquePolicy.EQUAL, OPTIMAL: TorquePolicy.OPTIMAL}
"""Torque policies by name."""

JointAngles = tuple[tuple[str, float], ...]
"""Names and angles [rad] of joints."""


@dataclass(frozen=True)
class SweepOptions:
    """Options of `sweep_path` and of all that is built on it; they can be compared and hashed.

    Raises:
        ModelError: A value out of range; names the option and what would be right.
    """

    policy: str = EQUAL
    """EQUAL: all wheels pull alike; OPTIMAL: the torques that need the least friction."""
    friction: float | None = None
    """Coulomb friction coefficient; None: that of the rover file. A friction layer of the terrain
    comes first."""
    max_torque: float | None = None
    """Largest wheel torque [N m]; None: that of the rover file."""
    soil: str | None = None
    """Preset soil where the terrain names none (docs/soil.md); None: Coulomb friction."""
    joint_angles: Mapping[str, float] | JointAngles | None = None
    """Arm angles [rad] by joint name, kept as pairs; joints left out, and None: stowed."""
    payload: float | None = None
    """Mass at the arm's tip [kg]; None: that of the rover file."""
    tool_force: Any = None
    """(3,) force [N] that the surroundings exert on the arm's tip, body frame, kept as a tuple."""
    tool_moment: Any = None
    """(3,) moment [N m] that they exert on it, body frame, kept as a tuple."""
    backward: bool = False
    """Whether the rover drives backwards along the poses."""

    def __post_init__(self) -> None:
        if self.policy not in POLICIES:
            raise ModelError(
                f"no torque policy {self.policy!r}; policies are {', '.join(POLICIES)}"
            )
        for name in ("friction", "max_torque"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise ModelError(f"{name} is {value}; it must be above 0")
        for name in ("tool_force", "tool_moment"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, tuple(as_vector(name, given).tolist()))
        if self.joint_angles is not None:
            object.__setattr__(self, "joint_angles", tuple(dict(self.joint_angles).items()))

    @property
    def direction(self) -> float:
        """1.0 where the rover drives forwards, -1.0 backwards."""
        return -1.0 if self.backward else 1.0

    @property
    def arm_angles(self) -> dict[str, float] | None:
        """Arm angles [rad] by joint name, None for the stowed arm."""
        return None if self.joint_angles is None else dict(self.joint_angles)


DEFAULT_OPTIONS = SweepOptions()
"""Equal torques, the numbers of the rover file, arm stowed, forwards."""
