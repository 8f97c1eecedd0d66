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


def similar(rover: Rover, size: float, mass: float = 0.0, gravity: float = 1.0) -> Rover:
    """Return a rover of the same shape, `size` times as large, on ground that is as large.

    Its mass is `mass` times as large, or 0: of the same density, and gravity `gravity` times. Its
    torques, speeds and rates are such that it does the same in a time that is sqrt(size / gravity)
    times as long.
    """
    wheel, suspension, masses, arm = rover.wheel, rover.suspension, rover.masses, rover.manipulator
    belly, limits, uncertainty = rover.belly, rover.limits, rover.uncertainty
    mass = mass or size**3
    rate = math.sqrt(gravity / size)

    def scale(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(size * value for value in values)

    def enlarge(part: Part) -> Part:
        return Part(mass * part.mass, scale(part.com))

    return replace(
        rover,
        gravity=gravity * rover.gravity,
        nominal_speed=size * rate * rover.nominal_speed,
        wheel=replace(
            wheel,
            radius=size * wheel.radius,
            width=size * wheel.width,
            mass=mass * wheel.mass,
            max_torque=mass * gravity * size * wheel.max_torque,
            max_speed=rate * wheel.max_speed,
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
        manipulator=arm
        and replace(
            arm,
            base=scale(arm.base),
            link_lengths=scale(arm.link_lengths),
            link_masses=tuple(mass * one for one in arm.link_masses),
            payload=mass * arm.payload,
        ),
        steering=rover.steering and replace(rover.steering, rate=rate * rover.steering.rate),
        uncertainty=replace(
            uncertainty,
            mass=mass * uncertainty.mass,
            com=size * uncertainty.com,
            position=size * uncertainty.position,
        ),
    )


SIMILAR = {
    "small": (0.25,),
    "large": (16.0,),
    "light": (1.0, 0.25),
    "on_the_moon": (1.0, 1.0, 0.25),
}
"""Sizes, masses and gravities of `similar` rovers, powers of 4: they round alike, to the bit."""
