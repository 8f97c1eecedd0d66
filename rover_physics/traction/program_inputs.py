# SPDX-License-Identifier: Apache-2.0
"""What the quadratic program (QP) is given beside the balance: limits of the wheels, weights."""

from dataclasses import astuple, dataclass
from functools import cached_property

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type

WEIGHTS = record_type(("peak", float), ("effort", float), ("change", float), ("slack", float))
"""`TractionWeights` as the kernels read them."""


@dataclass(frozen=True)
class TractionWeights:
    """Weights of the objective, for scaled variables: tractions and peak are of order one.

    1/2 peak u^2 + 1/2 effort |T|^2 + 1/2 change |(T, s0, s1) - last|^2 + slack * (slacks).
    """

    peak: float = 10.0
    """Weight of the squared peak utilisation. It comes first: 1,000 times the effort."""
    effort: float = 0.01
    """Weight of the squared tractions: it decides where several sets have the smallest peak."""
    change: float = 3.0
    """Weight of the squared change since the last answer; smaller ones take OSQP longer."""
    slack: float = 100.0
    """Price of a slack: more than a peak can be worth, so that no limit gives way to another."""


DEFAULT_WEIGHTS = TractionWeights()
"""Weights where none are given."""

PROGRAM_INPUTS = record_type(
    ("friction", float, (WHEEL_COUNT,)),  # friction coefficients
    ("max_torque", float),  # largest torque of a wheel [N m]
    ("radius", float),  # wheel radius [m]
    ("weights", WEIGHTS),
)
"""`ProgramInputs` as the kernels read them."""


@dataclass(frozen=True, eq=False)
class ProgramInputs:
    """Friction and torque that the wheels can count on, and the weights of the objective.

    Raises:
        ModelError: A friction coefficient, the largest torque or the radius is not above 0.
    """

    friction: np.ndarray
    """(6,) friction coefficients."""
    max_torque: float
    """Largest torque of a wheel [N m]."""
    radius: float
    """Wheel radius [m]."""
    weights: TractionWeights = DEFAULT_WEIGHTS
    """Weights of the objective."""

    def __post_init__(self) -> None:
        """Check all values."""
        check_program_inputs(self.friction, self.max_torque, self.radius)

    @cached_property
    def packed(self) -> np.ndarray:
        """Array (1,) of PROGRAM_INPUTS, made once."""
        numbers = self.friction, self.max_torque, self.radius, astuple(self.weights)
        return np.array([numbers], PROGRAM_INPUTS)


def check_program_inputs(friction: np.ndarray, max_torque: float, radius: float) -> None:
    """Raise ModelError where friction (6,), largest torque or wheel radius is not above 0."""
    if not (friction.min() > 0.0 and max_torque > 0.0 and radius > 0.0):
        raise ModelError(
            f"friction {friction.tolist()}, largest torque {max_torque} N m and wheel radius "
            f"{radius} m must all be above 0"
        )


@kernel
def max_pull_of(inputs, force_unit):
    """Return the largest traction of a motor in force units: torque over wheel radius.

    `inputs` is a record PROGRAM_INPUTS, `force_unit` in [N].
    """
    return inputs.max_torque / (inputs.radius * force_unit)
