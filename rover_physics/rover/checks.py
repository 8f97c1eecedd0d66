# SPDX-License-Identifier: Apache-2.0
"""Checks of a rover: parameters that agree, a stand on flat ground, numbers that are plausible."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from rover_physics.errors import ModelError
from rover_physics.files.validation import refuse
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS, WHEEL_POSITIONS
from rover_physics.numerics import plausible as known
from rover_physics.rover.model import Rover, Suspension

_LEVEL_TOLERANCE = 1e-3  # m, largest height difference of level wheels


RANGES = {
    "gravity": (known.MIN_GRAVITY, known.MAX_GRAVITY),
    "friction": (known.MIN_FRICTION, known.MAX_FRICTION),
    "nominal_speed": (known.MIN_SPEED, known.MAX_SPEED),
    "wheel.radius": (known.MIN_LENGTH, known.MAX_LENGTH),
    "wheel.width": (known.MIN_LENGTH, known.MAX_LENGTH),
    "wheel.max_torque": (known.MIN_TORQUE, known.MAX_TORQUE),
    "wheel.max_speed": (known.MIN_SPEED, known.MAX_SPEED),
    "wheel.servo_droop": (0.0, known.MAX_DROOP),
    "steering.limit": (known.MIN_STEERING, math.pi),
    "steering.rate": (known.MIN_SPEED, known.MAX_SPEED),
}
"""Smallest and largest values by dotted key, in SI units."""


def check_rover(rover: Rover) -> None:
    """Check the rules between several keys of a rover file.

    Args:
        rover: The rover as read; each number is already in its own range.

    Raises:
        RoverFileError: Two or more keys contradict each other; the text names the key to correct.
    """
    _check_wheels(rover)
    _check_pivots(rover.suspension)
    _check_joint_limits(rover.suspension)
    _check_belly(rover)
    _check_speed(rover)
    _check_balance(rover)
    _check_manipulator(rover)


def _check_wheels(rover: Rover) -> None:
    """Check that wheels are ordered rear to front, on the left side, level and apart."""
    wheels = rover.suspension.wheels
    width, diameter = rover.wheel.width, 2.0 * rover.wheel.radius
    for position in WHEEL_POSITIONS:
        wheel = wheels[position]
        key = f"suspension.wheels.{position}"
        if wheel[1] < width / 2.0:
            raise refuse(
                key, wheel, f"on the left side, y at least half the wheel width, {width / 2.0:g} m"
            )
        if abs(wheel[2] - wheels["rear"][2]) > _LEVEL_TOLERANCE:
            level = wheels["rear"][2]
            raise refuse(key, wheel, f"as high as the rear wheel, z = {level:g}, on flat ground")
    for behind, ahead in (("rear", "middle"), ("middle", "front")):
        spacing = wheels[ahead][0] - wheels[behind][0]
        key = f"suspension.wheels.{ahead}"
        if spacing <= 0.0:
            at = wheels[behind][0]
            raise refuse(key, wheels[ahead], f"ahead of the {behind} wheel, x above {at:g}")
        beside = abs(wheels[ahead][1] - wheels[behind][1]) >= width
        if spacing < diameter and not beside:
            raise refuse(
                key,
                wheels[ahead],
                f"a wheel diameter, {diameter:g} m, ahead of the {behind} wheel",
            )


def _check_pivots(suspension: Suspension) -> None:
    """Check that the rocker pivot is on the body's y axis and each pivot between its parts."""
    pivot, bogie, wheels = suspension.rocker_pivot, suspension.bogie_pivot, suspension.wheels
    if abs(pivot[0]) > 1e-9 or abs(pivot[2]) > 1e-9:
        raise refuse(
            "suspension.rocker_pivot",
            pivot,
            f"[0, {pivot[1]:g}, 0]: the origin of the body frame is midway between the pivots",
        )
    if pivot[1] <= 0.0:
        raise refuse("suspension.rocker_pivot", pivot, "on the left side, y above 0")
    if bogie[1] <= 0.0:
        raise refuse("suspension.bogie_pivot", bogie, "on the left side, y above 0")
    behind, ahead = suspension.bogie_wheels
    low, high = wheels[behind][0], wheels[ahead][0]
    if not low < bogie[0] < high:
        raise refuse(
            "suspension.bogie_pivot",
            bogie,
            f"between its two wheels, {behind} and {ahead}, x from {low:g} to {high:g}",
        )
    ends = sorted((wheels[suspension.rocker_wheel][0], bogie[0]))
    if not ends[0] < pivot[0] < ends[1]:
        raise refuse(
            "suspension.rocker_pivot",
            pivot,
            f"between the {suspension.rocker_wheel} wheel and the bogie pivot, "
            f"whose x are {ends[0]:g} and {ends[1]:g}",
        )


def _check_joint_limits(suspension: Suspension) -> None:
    """Check that angle 0, flat ground, is within the limits and no joint makes a full turn."""
    for name in ("rocker_limits", "bogie_limits"):
        low, high = getattr(suspension, name)
        if not -math.pi < low <= 0.0 <= high < math.pi:
            raise refuse(
                f"suspension.{name}",
                (low, high),
                "within -3.14 to 3.14 rad and contain 0, the angle on flat ground",
            )


def _check_belly(rover: Rover) -> None:
    """Check that the belly is above flat ground."""
    ground = rover.suspension.wheels["rear"][2] - rover.wheel.radius
    if rover.belly.z <= ground:
        raise refuse("belly.z", rover.belly.z, f"above the ground under the wheels, {ground:g} m")


def _check_speed(rover: Rover) -> None:
    """Check that the wheels can reach the nominal speed."""
    fastest = rover.wheel.max_speed * rover.wheel.radius
    if rover.nominal_speed > fastest:
        raise refuse(
            "nominal_speed",
            rover.nominal_speed,
            f"at most wheel.max_speed x wheel.radius = {fastest:g} m/s",
        )


def _check_balance(rover: Rover) -> None:
    """Check that the rover stands on flat ground, with its centre of mass between the wheels."""
    wheels, masses = rover.suspension.wheels, rover.masses
    if masses.body.mass <= 0.0:
        raise refuse("masses.body.mass", masses.body.mass, "a number above 0 in kg")
    moment = masses.body.mass * masses.body.com[0]
    for part in (masses.rocker, masses.bogie):
        moment += 2.0 * part.mass * part.com[0]
    moment += 2.0 * rover.wheel.mass * sum(wheel[0] for wheel in wheels.values())
    x = moment / rover.total_mass
    y = masses.body.mass * masses.body.com[1] / rover.total_mass
    half_track = min(wheel[1] for wheel in wheels.values())
    if not wheels["rear"][0] < x < wheels["front"][0] or abs(y) >= half_track:
        raise refuse(
            "masses.body.com",
            masses.body.com,
            f"such that the rover's centre of mass, now x = {x:.3g}, y = {y:.3g} m, "
            "is between the wheels",
        )


def _check_manipulator(rover: Rover) -> None:
    """Check the arm: lighter than the body, stowed within its limits, with joint names unused."""
    arm = rover.manipulator
    if arm is None:
        return
    if sum(arm.link_masses) >= rover.masses.body.mass:
        raise refuse(
            "manipulator.link_masses",
            arm.link_masses,
            f"together below masses.body.mass, {rover.masses.body.mass:g} kg, which includes them",
        )
    for name, angle, (low, high) in zip(
        arm.joints, arm.stowed, arm.joint_limits or (), strict=arm.joint_limits is not None
    ):
        if not low <= angle <= high:
            raise refuse(
                "manipulator.stowed",
                arm.stowed,
                f"within manipulator.joint_limits, for {name} from {low:g} to {high:g} rad",
            )
    taken = set(arm.joints) & {*SUSPENSION_JOINTS, *WHEEL_JOINTS}
    if taken:
        raise refuse(
            "manipulator.joints",
            arm.joints,
            f"names of the arm's own: {', '.join(sorted(taken))} belongs to the suspension",
        )


def check_plausible(rover: Rover) -> None:
    """Check that each number of a rover, which need not come from a file, is in a plausible range.

    Raises:
        ModelError: A number that is not; the text names its key in a rover file and the range.
    """
    for key, number in _numbers_of(rover):
        least, most = RANGES.get(key, (-known.MAX_COORDINATE, known.MAX_COORDINATE))
        if key.endswith("mass"):
            least, most = 0.0, known.MAX_MASS
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
