"""The rover: geometry, masses, actuators and safety limits, and how they are read from a file."""

from dataclasses import dataclass
from pathlib import Path

from rover_physics.config_files import find_config
from rover_physics.config_section import ConfigSection
from rover_physics.errors import RoverFileError
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.rover_checks import check_rover
from rover_physics.yaml_file import read_yaml

Point = tuple[float, float, float]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Wheel:
    """One wheel with its drive; all six are alike."""

    radius: float
    """Radius in [m]."""
    width: float
    """Width of the tread in [m]."""
    mass: float
    """Mass with drive in [kg]."""
    max_torque: float
    """Largest torque of the drive in [N m]."""
    max_speed: float
    """Largest speed of the drive in [rad/s]."""


@dataclass(frozen=True)
class Suspension:
    """Pivots and wheel centres of the left side on flat ground, body frame, [m]."""

    rocker_pivot: Point
    """Where the rocker is hinged to the body; the origin is midway between the two pivots."""
    bogie_pivot: Point
    """Where the bogie is hinged to the rocker."""
    rocker_wheel: str
    """The wheel on the rocker itself, ``"rear"`` or ``"front"``; the others are on the bogie."""
    wheels: dict[str, Point]
    """Wheel centres, keys ``"rear"``, ``"middle"``, ``"front"``."""
    rocker_limits: Interval
    """Lowest and highest rocker angle in [rad]."""
    bogie_limits: Interval
    """Lowest and highest bogie angle in [rad]."""

    @property
    def bogie_wheels(self) -> tuple[str, str]:
        """Names of the two wheels on the bogie, rear to front."""
        return ("middle", "front") if self.rocker_wheel == "rear" else ("rear", "middle")


@dataclass(frozen=True)
class Part:
    """A rigid part."""

    mass: float
    """Mass in [kg]."""
    com: Point
    """Centre of mass in [m], body frame, left side, flat ground."""


@dataclass(frozen=True)
class Masses:
    """The parts that carry mass, apart from the wheels."""

    body: Part
    """The body with everything on it, the stowed manipulator included."""
    rocker: Part
    """One rocker, without its wheel."""
    bogie: Part
    """One bogie, without its wheels."""


@dataclass(frozen=True)
class Belly:
    """The underside of the body: a rectangle in the body frame."""

    z: float
    """Height in [m]."""
    x: Interval
    """Rear and front edge in [m]."""
    y: Interval
    """Right and left edge in [m]."""


@dataclass(frozen=True)
class Limits:
    """Safety limits that a path is judged by."""

    tilt: float
    """Largest angle between body z and the vertical in [rad]."""
    tip_over_ratio: float
    """Smallest tip-over angle relative to the one on flat ground."""
    friction_utilisation: float
    """Largest share of the friction that a wheel may use."""
    torque_saturation: float
    """Largest share of the drive torque that a wheel may use."""
    belly_clearance: float
    """Smallest height of the belly over the ground in [m]."""
    wheel_drop: float
    """Largest height that a wheel may drop when it rolls off an edge in [m]."""


@dataclass(frozen=True)
class Manipulator:
    """An arm of three joints: base yaw about z, shoulder and elbow about y.

    At zero joint angles the column stands up from the base along +z, upper arm and forearm point
    forward along +x. Angles are right-handed: positive shoulder and elbow lower the arm.
    """

    base: Point
    """Foot of the column in [m], body frame."""
    joints: tuple[str, str, str]
    """Names of base yaw, shoulder and elbow in ``joint_states``."""
    link_lengths: tuple[float, float, float]
    """Column, upper arm and forearm in [m]."""
    link_masses: tuple[float, float, float]
    """Masses of the same in [kg], each at the middle of its link."""
    stowed: tuple[float, float, float]
    """Joint angles of the stowed pose in [rad], the one that the body's mass centre is for."""
    payload: float = 0.0
    """Mass at the tip in [kg]."""
    joint_limits: tuple[Interval, ...] | None = None
    """Lowest and highest angle of each joint in [rad]; None: the joints turn without end."""


@dataclass(frozen=True)
class Rover:
    """A rocker-bogie rover with six wheels and a differential."""

    name: str
    """What the rover is called."""
    gravity: float
    """Acceleration of gravity in [m/s^2]."""
    wheel: Wheel
    """The wheel, six times."""
    suspension: Suspension
    """Pivots, wheel centres and joint limits."""
    masses: Masses
    """Body, rockers and bogies."""
    belly: Belly
    """Underside of the body, for its clearance."""
    friction: float
    """Coulomb friction coefficient where the terrain says nothing of it."""
    nominal_speed: float
    """Driving speed in [m/s]."""
    limits: Limits
    """Safety limits."""
    manipulator: Manipulator | None = None
    """The arm, if there is one."""

    @property
    def total_mass(self) -> float:
        """Mass in [kg] of body, two rockers, two bogies and six wheels, without payload."""
        masses = self.masses
        sides = 2.0 * (masses.rocker.mass + masses.bogie.mass)
        return masses.body.mass + sides + 6.0 * self.wheel.mass

    @property
    def weight(self) -> float:
        """Weight of the whole rover in [N], without payload."""
        return self.total_mass * self.gravity


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
