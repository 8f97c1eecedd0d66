# SPDX-License-Identifier: Apache-2.0
"""The rovers that come with the package, and some that steer otherwise; all tests share them."""

import math
from dataclasses import replace

from rover_physics import load_rover
from rover_physics.rover.model import Part, Rover, Steering

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
FIXED = replace(LSR1, steering=None)
"""The rover lsr1 with wheels that do not steer."""
ALL_STEER = replace(LSR1, steering=Steering(("rear", "middle", "front"), 0.5 * math.pi, 0.35))
"""The rover lsr1 with six wheels that steer."""


def similar(rover: Rover, size: float) -> Rover:
    """Return a rover of the same shape and density, `size` times as large, that moves alike.

    Gravity and speed are as many times as large, so that what it does takes the same time.
    """
    wheel, suspension, masses = rover.wheel, rover.suspension, rover.masses
    belly, limits, uncertainty = rover.belly, rover.limits, rover.uncertainty

    def scale(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(size * value for value in values)

    def enlarge(part: Part) -> Part:
        return Part(size**3 * part.mass, scale(part.com))

    return replace(
        rover,
        gravity=size * rover.gravity,
        nominal_speed=size * rover.nominal_speed,
        manipulator=None,
        wheel=replace(
            wheel,
            radius=size * wheel.radius,
            width=size * wheel.width,
            mass=size**3 * wheel.mass,
            max_torque=size**5 * wheel.max_torque,
        ),
        suspension=replace(
            suspension,
            rocker_pivot=scale(suspension.rocker_pivot),
            bogie_pivot=scale(suspension.bogie_pivot),
            wheels={name: scale(place) for name, place in suspension.wheels.items()},
        ),
        masses=replace(
            masses,
            body=enlarge(masses.body),
            rocker=enlarge(masses.rocker),
            bogie=enlarge(masses.bogie),
        ),
        belly=replace(belly, z=size * belly.z, x=scale(belly.x), y=scale(belly.y)),
        limits=replace(
            limits,
            belly_clearance=size * limits.belly_clearance,
            wheel_drop=size * limits.wheel_drop,
        ),
        uncertainty=replace(
            uncertainty, com=size * uncertainty.com, position=size * uncertainty.position
        ),
    )
