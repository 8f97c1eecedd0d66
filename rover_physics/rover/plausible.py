# SPDX-License-Identifier: Apache-2.0
"""Checks the numbers of a rover before kernels use them; a rover need not come from a file."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from rover_physics.errors import ModelError
from rover_physics.numerics.plausible import (
    MAX_COORDINATE,
    MAX_DROOP,
    MAX_FRICTION,
    MAX_GRAVITY,
    MAX_LENGTH,
    MAX_MASS,
    MAX_SPEED,
    MAX_TORQUE,
    MIN_FRICTION,
    MIN_GRAVITY,
    MIN_LENGTH,
    MIN_SPEED,
    MIN_STEERING,
    MIN_TORQUE,
)
from rover_physics.rover.model import Rover

RANGES = {
    "gravity": (MIN_GRAVITY, MAX_GRAVITY),
    "friction": (MIN_FRICTION, MAX_FRICTION),
    "nominal_speed": (MIN_SPEED, MAX_SPEED),
    "wheel.radius": (MIN_LENGTH, MAX_LENGTH),
    "wheel.width": (MIN_LENGTH, MAX_LENGTH),
    "wheel.max_torque": (MIN_TORQUE, MAX_TORQUE),
    "wheel.max_speed": (MIN_SPEED, MAX_SPEED),
    "wheel.servo_droop": (0.0, MAX_DROOP),
    "steering.limit": (MIN_STEERING, math.pi),
    "steering.rate": (MIN_SPEED, MAX_SPEED),
}
"""Smallest and largest values by dotted key, in SI units."""


def check_plausible(rover: Rover) -> None:
    """Check that each number of a rover is finite and in a plausible range.

    Raises:
        ModelError: A number that is not; the text names its key in a rover file and the range.
    """
    for key, number in _numbers_of(rover):
        least, most = RANGES.get(key, (-MAX_COORDINATE, MAX_COORDINATE))
        if key.endswith("mass"):
            least, most = 0.0, MAX_MASS
        if not least <= number <= most:
            raise ModelError(
                f"rover {rover.name!r}: {key} is {number}; it must be from {least:g} to {most:g}"
            )


def _numbers_of(value: Any, key: str = "") -> Iterator[tuple[str, float]]:
    """Yield dotted keys and numbers of nested dataclasses, dicts and tuples."""
    parts: Sequence[tuple[str | int, Any]] = ()
    if is_dataclass(value):
        parts = [(field.name, getattr(value, field.name)) for field in fields(value)]
    elif isinstance(value, dict):
        parts = list(value.items())
    elif isinstance(value, tuple):
        parts = list(enumerate(value))
    elif isinstance(value, int | float):
        yield key, value
    for name, inner in parts:
        yield from _numbers_of(inner, f"{key}.{name}" if key else str(name))
