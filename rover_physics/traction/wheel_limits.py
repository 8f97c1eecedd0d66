"""What the wheels can give: friction of the ground below them, and torque of their motors."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type

WHEEL_LIMITS = record_type(
    ("friction", float, (WHEEL_COUNT,)),  # friction coefficients
    ("max_torque", float),  # largest torque of a wheel [N m]
    ("radius", float),  # wheel radius [m]
)
"""`WheelLimits` as the kernels read it."""


@dataclass(frozen=True, eq=False)
class WheelLimits:
    """Friction and torque that the wheels can count on.

    Raises:
        ModelError: A friction coefficient, the largest torque or the radius is not above 0.
    """

    friction: np.ndarray
    """(6,) friction coefficients."""
    max_torque: float
    """Largest torque of a wheel [N m]."""
    radius: float
    """Wheel radius [m]."""

    def __post_init__(self) -> None:
        """Check all values."""
        if not (self.friction.min() > 0.0 and self.max_torque > 0.0 and self.radius > 0.0):
            raise ModelError(
                f"friction {self.friction.tolist()}, largest torque {self.max_torque} N m and "
                f"wheel radius {self.radius} m must all be above 0"
            )

    @cached_property
    def packed(self) -> np.ndarray:
        """Array (1,) of WHEEL_LIMITS, made once."""
        return array_of(
            new_record(
                WHEEL_LIMITS,
                friction=self.friction,
                max_torque=self.max_torque,
                radius=self.radius,
            )
        )


@kernel
def max_pull_of(limits, force_unit):
    """Return the largest traction of a motor in force units: torque over wheel radius.

    `limits` is a record WHEEL_LIMITS, `force_unit` in [N].
    """
    return limits.max_torque / (limits.radius * force_unit)
