# SPDX-License-Identifier: Apache-2.0
"""The rovers that come with the package, and some that steer otherwise; all tests share them."""

import math
from dataclasses import replace
from typing import Any

from rover_physics import load_rover
from rover_physics.files.validation import Key, find_rule
from rover_physics.rover.model import Rover, Steering
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
FIXED = replace(LSR1, steering=None)
"""The rover lsr1 with wheels that do not steer."""
ALL_STEER = replace(LSR1, steering=Steering(("rear", "middle", "front"), 0.5 * math.pi, 0.35))
"""The rover lsr1 with six wheels that steer."""


def similar(rover: Rover, size: float, mass: float = 0.0, gravity: float = 1.0) -> Rover:
    """Return a rover of the same shape, `size` times as large, on ground that is as large.

    Its mass is `mass` times as large, or 0: of the same density, and gravity `gravity` times. Its
    torques, speeds and rates are such that it does the same in a time that is sqrt(size / gravity)
    times as long.
    """
    mass = mass or size**3
    rate = math.sqrt(gravity / size)
    factors = {
        "m": size, "kg": mass, "m/s^2": gravity, "m/s": size * rate, "rad/s": rate,
        "N m": mass * gravity * size,
    }  # fmt: skip

    def scale(values: Any, key: tuple[Key, ...] = ()) -> Any:
        if isinstance(values, dict):
            return {name: scale(one, (*key, name)) for name, one in values.items()}
        if isinstance(values, list):
            return [scale(one, (*key, k)) for k, one in enumerate(values)]
        is_number = isinstance(values, float)
        return values * factors.get(find_rule(Rover, key).unit, 1.0) if is_number else values

    return rover_from_dict(scale(rover_to_dict(rover)), rover.name)


SIMILAR = {
    "small": (0.25,),
    "large": (16.0,),
    "light": (1.0, 0.25),
    "on_the_moon": (1.0, 1.0, 0.25),
}
"""Sizes, masses and gravities of `similar` rovers, powers of 4: they round alike, to the bit."""
