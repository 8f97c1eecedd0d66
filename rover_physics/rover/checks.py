# SPDX-License-Identifier: Apache-2.0
"""Checks of a rover: parameters that agree, a stand on flat ground, numbers that are plausible."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import is_dataclass
from typing import Any

from rover_physics.errors import ModelError
from rover_physics.files.validation import ANY_NUMBER, Key, find_rule, refuse, show_key
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS, WHEEL_POSITIONS
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import MAX_DEVIATION

_LEVEL_TOLERANCE = 1e-3  # m, largest height difference of level wheels


Demand = tuple[bool, str, object, str]
"""True if it is met; the key, its value, and the text on what that must be."""


def check_rover(rover: Rover) -> None:
    """Check the rules between several keys of a rover file.

    Args:
        rover: The rover as read; each number is already in its own range.

    Raises:
        RoverFileError: Two or more keys contradict each other; the text names the key to correct.
    """
    for demands in (_of_wheels, _of_pivots, _of_other_parts, _of_balance, _of_manipulator):
        for is_met, key, value, must in demands(rover):
            if not is_met:
                raise refuse(key, value, must)


def _of_wheels(rover: Rover) -> Iterator[Demand]:
    """Yield that wheels are ordered rear to front, on the left side, level and apart."""
    wheels = rover.suspension.wheels
    half, diameter, level = rover.wheel.width / 2.0, 2.0 * rover.wheel.radius, wheels["rear"][2]
    for position in WHEEL_POSITIONS:
        wheel, key = wheels[position], f"suspension.wheels.{position}"
        left = f"on the left side, y at least half the wheel width, {half:g} m"
        yield wheel[1] >= half, key, wheel, left
        high = f"as high as the rear wheel, z = {level:g}, on flat ground"
        yield abs(wheel[2] - level) <= _LEVEL_TOLERANCE, key, wheel, high
    for behind, ahead in (("rear", "middle"), ("middle", "front")):
        (x, y, _), wheel, key = wheels[behind], wheels[ahead], f"suspension.wheels.{ahead}"
        yield wheel[0] > x, key, wheel, f"ahead of the {behind} wheel, x above {x:g}"
        is_apart = wheel[0] - x >= diameter or abs(wheel[1] - y) >= rover.wheel.width
        yield (
            is_apart,
            key,
            wheel,
            f"a wheel diameter, {diameter:g} m, ahead of the {behind} wheel",
        )


def _of_pivots(rover: Rover) -> Iterator[Demand]:
    """Yield that the rocker pivot is on the body's y axis and each pivot between its parts."""
    suspension = rover.suspension
    pivot, bogie, wheels = suspension.rocker_pivot, suspension.bogie_pivot, suspension.wheels
    key, bogie_key = "suspension.rocker_pivot", "suspension.bogie_pivot"
    middle = f"[0, {pivot[1]:g}, 0]: the origin of the body frame is midway between the pivots"
    yield abs(pivot[0]) <= 1e-9 and abs(pivot[2]) <= 1e-9, key, pivot, middle
    yield pivot[1] > 0.0, key, pivot, "on the left side, y above 0"
    yield bogie[1] > 0.0, bogie_key, bogie, "on the left side, y above 0"
    behind, ahead = suspension.bogie_wheels
    low, high = wheels[behind][0], wheels[ahead][0]
    between = f"between its two wheels, {behind} and {ahead}, x from {low:g} to {high:g}"
    yield low < bogie[0] < high, bogie_key, bogie, between
    alone = suspension.rocker_wheel
    low, high = sorted((wheels[alone][0], bogie[0]))
    between = f"between the {alone} wheel and the bogie pivot, whose x are {low:g} and {high:g}"
    yield low < pivot[0] < high, key, pivot, between
    for name in ("rocker_limits", "bogie_limits"):
        low, high = getattr(suspension, name)
        within = "within -3.14 to 3.14 rad and contain 0, the angle on flat ground"
        yield -math.pi < low <= 0.0 <= high < math.pi, f"suspension.{name}", (low, high), within


def _of_other_parts(rover: Rover) -> Iterator[Demand]:
    """Yield that the belly is above flat ground, and that wheels reach the nominal speed."""
    ground = rover.suspension.wheels["rear"][2] - rover.wheel.radius
    above = f"above the ground under the wheels, {ground:g} m"
    yield rover.belly.z > ground, "belly.z", rover.belly.z, above
    fastest, speed = rover.wheel.max_speed * rover.wheel.radius, rover.nominal_speed
    most = f"at most wheel.max_speed x wheel.radius = {fastest:g} m/s"
    yield speed <= fastest, "nominal_speed", speed, most


def _of_balance(rover: Rover) -> Iterator[Demand]:
    """Yield that the rover stands on flat ground, with its centre of mass between the wheels."""
    wheels, masses = rover.suspension.wheels, rover.masses
    mass, com, deviation = masses.body.mass, masses.body.com, rover.uncertainty.mass
    yield mass > 0.0, "masses.body.mass", mass, "a number above 0 in kg"
    light = f"at most {MAX_DEVIATION:g} of masses.body.mass, {MAX_DEVIATION * mass:g} kg"
    yield deviation <= MAX_DEVIATION * mass, "uncertainty.mass", deviation, light
    moment = mass * com[0]
    for part in (masses.rocker, masses.bogie):
        moment += 2.0 * part.mass * part.com[0]
    moment += 2.0 * rover.wheel.mass * sum(wheel[0] for wheel in wheels.values())
    x, y = moment / rover.total_mass, mass * com[1] / rover.total_mass
    is_ahead = wheels["rear"][0] < x < wheels["front"][0]
    is_inside = is_ahead and abs(y) < min(wheel[1] for wheel in wheels.values())
    now = f"now x = {x:.3g}, y = {y:.3g} m"
    inside = f"such that the rover's centre of mass, {now}, is between the wheels"
    yield is_inside, "masses.body.com", com, inside


def _of_manipulator(rover: Rover) -> Iterator[Demand]:
    """Yield that the arm is lighter than the body, stowed within its limits, its names unused."""
    arm = rover.manipulator
    if arm is None:
        return
    mass = rover.masses.body.mass
    lighter = f"together below masses.body.mass, {mass:g} kg, which includes them"
    yield sum(arm.link_masses) < mass, "manipulator.link_masses", arm.link_masses, lighter
    for name, angle, (low, high) in zip(
        arm.joints, arm.stowed, arm.joint_limits or (), strict=arm.joint_limits is not None
    ):
        within = f"within manipulator.joint_limits, for {name} from {low:g} to {high:g} rad"
        yield low <= angle <= high, "manipulator.stowed", arm.stowed, within
    taken = set(arm.joints) & {*SUSPENSION_JOINTS, *WHEEL_JOINTS}
    own = f"names of the arm's own: {', '.join(sorted(taken))} belongs to the suspension"
    yield not taken, "manipulator.joints", arm.joints, own


def check_plausible(rover: Rover) -> None:
    """Check that each number of a rover, which need not come from a file, keeps the file's rule.

    Limits may be any numbers: code lifts them.

    Raises:
        ModelError: A number that does not; the text names its key in a rover file and the rule.
    """
    for key, value in _numbers_of(rover):
        rule = ANY_NUMBER if key[0] == "limits" else find_rule(Rover, key)
        if not rule.holds(value):
            raise ModelError(f"rover {rover.name!r}: {refuse(show_key(key), value, rule.must)}")


def _numbers_of(value: Any, key: Key = ()) -> Iterator[tuple[Key, float]]:
    """Yield keys and numbers of nested dataclasses, dicts and tuples."""
    parts: Iterable[tuple[str | int, Any]] = ()
    if is_dataclass(value):
        parts = vars(value).items()
    elif isinstance(value, dict):
        parts = value.items()
    elif isinstance(value, tuple):
        parts = enumerate(value)
    elif isinstance(value, int | float):
        yield key, value
    for name, inner in parts:
        yield from _numbers_of(inner, (*key, name))
