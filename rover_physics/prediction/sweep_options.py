# SPDX-License-Identifier: Apache-2.0
"""Options of a prediction: torque policy, friction, torque, soil, arm and direction."""

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

from rover_physics.errors import ModelError
from rover_physics.names import EQUAL, OPTIMAL, TORQUE_POLICIES
from rover_physics.numerics import plausible as known
from rover_physics.rover.manipulator import as_vector
from rover_physics.status import TorquePolicy

POLICIES = dict(zip(TORQUE_POLICIES, TorquePolicy, strict=True))
"""Torque policies by name."""

JointAngles = tuple[tuple[str, float], ...]
"""Pairs of joint name and angle [rad]."""


@dataclass(frozen=True)
class SweepOptions:
    """Options of `judge_path` and of all that is built on it; comparable and hashable.

    Raises:
        ModelError: A value out of range; the text names the option and its range.
    """

    policy: str = EQUAL
    """EQUAL: equal torques on all wheels; SERVO: the torques of speed servos, on firm ground and
    soil; OPTIMAL: the torques that need the least friction."""
    control_margin: float = 0.0
    """Share of the limits of friction and torque that policy OPTIMAL leaves to the controller,
    0 to below 1; 0 is the physical limit. The other policies have none."""
    friction: float | None = None
    """Coulomb friction coefficient (default: that of the rover file). A friction layer of the
    terrain overrides it."""
    max_torque: float | None = None
    """Largest wheel torque [N m] (default: that of the rover file)."""
    soil: str | None = None
    """Preset soil where the terrain names none (default: Coulomb friction; docs/soil.md)."""
    joint_angles: Mapping[str, float] | JointAngles | None = None
    """Arm angles [rad] by joint name, stored as pairs. Joints left out are stowed, other names
    ignored; None stows all."""
    payload: float | None = None
    """Mass at the arm's tip [kg] (default: that of the rover file)."""
    tool_force: Any = None
    """(3,) force of the surroundings on the arm's tip [N], body frame, stored as a tuple (default:
    none)."""
    tool_moment: Any = None
    """(3,) moment of the surroundings on the arm's tip [N m], body frame, stored as a tuple
    (default: none)."""
    backward: bool = False
    """True if the rover drives backwards along the poses."""

    def __post_init__(self) -> None:
        for names, kind, must in (
            (("policy", "soil"), str, "a name"),
            (("control_margin", "friction", "max_torque", "payload"), Real, "a number"),
        ):
            for name in names:
                value = getattr(self, name)
                if not isinstance(value, kind) and value is not getattr(SweepOptions, name):
                    raise ModelError(f"{name} is {value!r}; it must be {must}")
        if self.policy not in POLICIES:
            raise ModelError(
                f"no torque policy {self.policy!r}; policies are {', '.join(POLICIES)}"
            )
        margin = self.control_margin
        if not 0.0 <= margin < 1.0:
            raise ModelError(f"control_margin is {margin}; it must be at least 0 and below 1")
        for name, least, most in (
            ("friction", known.MIN_FRICTION, known.MAX_FRICTION),
            ("max_torque", known.MIN_TORQUE, known.MAX_TORQUE),
        ):
            value = getattr(self, name)
            if value is not None and not least <= value <= most:
                raise ModelError(
                    f"{name} is {value}; it must be above 0, from {least:g} to {most:g}"
                )
        for name in ("tool_force", "tool_moment"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, tuple(as_vector(name, given).tolist()))
        if self.joint_angles is not None:
            object.__setattr__(self, "joint_angles", _pair_angles(self.joint_angles))

    @property
    def direction(self) -> float:
        """1.0 if the rover drives forwards, -1.0 if backwards."""
        return -1.0 if self.backward else 1.0

    @property
    def kept_margin(self) -> float:
        """The control margin of the policy: 0 for all but OPTIMAL."""
        return self.control_margin if self.policy == OPTIMAL else 0.0

    @property
    def arm_angles(self) -> dict[str, float] | None:
        """Arm angles [rad] by joint name; None if the arm is stowed."""
        return None if self.joint_angles is None else dict(self.joint_angles)


def _pair_angles(given: Any) -> JointAngles:
    """Return arm angles as pairs.

    Raises:
        ModelError: They are no numbers by name.
    """
    try:
        angles = dict(given)
    except (TypeError, ValueError):
        angles = {"": None}
    if not all(isinstance(angle, Real) for angle in angles.values()):
        raise ModelError(f"joint_angles is {given!r}; it must be numbers by joint name")
    return tuple(angles.items())


DEFAULT_OPTIONS = SweepOptions()
"""Equal torques, values of the rover file, arm stowed, forwards."""
