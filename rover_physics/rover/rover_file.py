"""How a rover is read from a file: presets, and YAML files with the same keys."""

from pathlib import Path

from rover_physics.errors import RoverFileError
from rover_physics.files.config_files import find_config
from rover_physics.files.config_section import ConfigSection
from rover_physics.files.yaml_file import read_yaml
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.rover.checks import check_rover
from rover_physics.rover.model import (
    Belly,
    Limits,
    Manipulator,
    Masses,
    Part,
    Rover,
    Suspension,
    Wheel,
)


def preset_names() -> tuple[str, ...]:
    """Return the names of the rovers that come with the package, sorted."""
    return tuple(sorted(path.stem for path in find_config("rovers").glob("*.yaml")))


def load_rover(name_or_path: str | Path) -> Rover:
    """Load a rover by the name of a preset or from a file.

    Args:
        name_or_path: A preset's name such as ``"lsr1"``, or the path of a YAML file.

    Raises:
        RoverFileError: Neither a preset nor a file, or the file is wrong; names the key.
    """
    name = str(name_or_path)
    presets = preset_names()
    if name in presets and not isinstance(name_or_path, Path):
        path = find_config(f"rovers/{name}.yaml")
    else:
        path = Path(name_or_path)
        if not path.exists():
            raise RoverFileError(
                f"no rover {name!r}: it is no file, and the presets are {', '.join(presets)}"
            )
    return rover_from_dict(read_yaml(path), str(path))


def rover_from_dict(data: object, source: str) -> Rover:
    """Build a rover from the contents of a rover file.

    Args:
        data: Nested mapping with the keys of a rover file (docs/conventions.md); SI units,
            positions of the left side in the body frame.
        source: File name or other origin, opens every error text.

    Raises:
        RoverFileError: A key is missing, unknown or impossible; names the dotted key.
    """
    required = (
        "name",
        "gravity",
        "wheel",
        "suspension",
        "masses",
        "belly",
        "friction",
        "nominal_speed",
        "limits",
    )
    top = ConfigSection(data, source, "", required, ("manipulator",))
    rover = Rover(
        name=top.text("name"),
        gravity=top.number("gravity", "m/s^2", above=0.0),
        wheel=_read_wheel(top),
        suspension=_read_suspension(top),
        masses=_read_masses(top),
        belly=_read_belly(top),
        friction=top.number("friction", "", above=0.0),
        nominal_speed=top.number("nominal_speed", "m/s", above=0.0),
        limits=_read_limits(top),
        manipulator=_read_manipulator(top) if top.has("manipulator") else None,
    )
    check_rover(rover, source)
    return rover


def _read_wheel(top: ConfigSection) -> Wheel:
    wheel = top.section("wheel", ("radius", "width", "mass", "max_torque", "max_speed"))
    return Wheel(
        radius=wheel.number("radius", "m", above=0.0),
        width=wheel.number("width", "m", above=0.0),
        mass=wheel.number("mass", "kg", least=0.0),
        max_torque=wheel.number("max_torque", "N m", above=0.0),
        max_speed=wheel.number("max_speed", "rad/s", above=0.0),
    )


def _read_suspension(top: ConfigSection) -> Suspension:
    keys = (
        "rocker_pivot",
        "bogie_pivot",
        "rocker_wheel",
        "wheels",
        "rocker_limits",
        "bogie_limits",
    )
    suspension = top.section("suspension", keys)
    wheels = suspension.section("wheels", WHEEL_POSITIONS)
    return Suspension(
        rocker_pivot=suspension.point("rocker_pivot"),
        bogie_pivot=suspension.point("bogie_pivot"),
        rocker_wheel=suspension.choice("rocker_wheel", ("rear", "front")),
        wheels={position: wheels.point(position) for position in WHEEL_POSITIONS},
        rocker_limits=suspension.interval("rocker_limits", "rad"),
        bogie_limits=suspension.interval("bogie_limits", "rad"),
    )


def _read_masses(top: ConfigSection) -> Masses:
    masses = top.section("masses", ("body", "rocker", "bogie"))
    parts = {}
    for name in ("body", "rocker", "bogie"):
        part = masses.section(name, ("mass", "com"))
        parts[name] = Part(mass=part.number("mass", "kg", least=0.0), com=part.point("com"))
    if parts["body"].mass <= 0.0:
        raise masses.section("body", ("mass", "com")).error("mass", "a number above 0 in kg")
    return Masses(**parts)


def _read_belly(top: ConfigSection) -> Belly:
    belly = top.section("belly", ("z", "x", "y"))
    return Belly(
        z=belly.number("z", "m"),
        x=belly.interval("x", "m"),
        y=belly.interval("y", "m"),
    )


def _read_limits(top: ConfigSection) -> Limits:
    keys = (
        "tilt",
        "tip_over_ratio",
        "friction_utilisation",
        "torque_saturation",
        "belly_clearance",
        "wheel_drop",
    )
    limits = top.section("limits", keys)
    return Limits(
        tilt=limits.number("tilt", "rad", above=0.0, most=1.57),
        tip_over_ratio=limits.number("tip_over_ratio", "", least=0.0, most=1.0),
        friction_utilisation=limits.number("friction_utilisation", "", above=0.0, most=1.0),
        torque_saturation=limits.number("torque_saturation", "", above=0.0, most=1.0),
        belly_clearance=limits.number("belly_clearance", "m", least=0.0),
        wheel_drop=limits.number("wheel_drop", "m", least=0.0),
    )


def _read_manipulator(top: ConfigSection) -> Manipulator:
    keys = ("base", "joints", "link_lengths", "link_masses", "stowed")
    arm = top.section("manipulator", keys, ("payload", "joint_limits"))
    yaw, shoulder, elbow = arm.texts("joints", 3)
    column, upper_arm, forearm = arm.numbers("link_lengths", 3, "m")
    masses = arm.numbers("link_masses", 3, "kg")
    stowed = arm.numbers("stowed", 3, "rad")
    if min(column, upper_arm, forearm) < 0.0 or upper_arm + forearm == 0.0:
        raise arm.error("link_lengths", "3 numbers in m, none of them negative, the arm not 0")
    if min(masses) < 0.0:
        raise arm.error("link_masses", "3 numbers in kg, none of them negative")
    return Manipulator(
        base=arm.point("base"),
        joints=(yaw, shoulder, elbow),
        link_lengths=(column, upper_arm, forearm),
        link_masses=(masses[0], masses[1], masses[2]),
        stowed=(stowed[0], stowed[1], stowed[2]),
        payload=arm.number("payload", "kg", least=0.0) if arm.has("payload") else 0.0,
        joint_limits=arm.intervals("joint_limits", 3, "rad") if arm.has("joint_limits") else None,
    )
