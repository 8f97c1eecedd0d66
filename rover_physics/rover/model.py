# SPDX-License-Identifier: Apache-2.0
"""Rover parameters: geometry, masses, actuators and safety limits; the keys of a rover file."""

import math
from dataclasses import dataclass, field
from typing import Annotated

from rover_physics.files.rules import Keys, Radians, Rule, Text, choice, interval, number
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.numerics import plausible as known
from rover_physics.rover.uncertainty import Uncertainty

Metres = Annotated[float, number("m", least=-known.MAX_LENGTH, most=known.MAX_LENGTH)]
Point = Annotated[
    tuple[Metres, Metres, Metres],
    Rule(
        "a list of 3 numbers in m, [x, y, z] in the body frame, each from "
        f"{-known.MAX_LENGTH:g} to {known.MAX_LENGTH:g}"
    ),
]
"""A position on the rover in [m]."""
Size = Annotated[float, number("m", least=known.MIN_LENGTH, most=known.MAX_LENGTH)]
Speed = Annotated[float, number("m/s", least=known.MIN_SPEED, most=known.MAX_SPEED)]
Angles = Annotated[tuple[Radians, Radians], interval("rad")]
Edges = Annotated[tuple[Metres, Metres], interval("m")]
Mass = Annotated[float, number("kg", least=0.0, most=known.MAX_MASS)]
Share = Annotated[float, number("", above=0.0, most=1.0)]
DEFAULT_SERVO_DROOP = 0.3
"""Droop of a wheel's speed servo if the rover file has none."""


def _is_arm(lengths: tuple[float, float, float]) -> bool:
    """Return whether three lengths are valid for column, upper arm and forearm."""
    return min(lengths) >= 0.0 and lengths[1] + lengths[2] >= known.MIN_LENGTH


def _are_axles(names: tuple[str, ...]) -> bool:
    """Return whether names are one or more of WHEEL_POSITIONS, each at most once."""
    return bool(names) and set(names) <= set(WHEEL_POSITIONS) and len(set(names)) == len(names)


def _are_names(texts: tuple[str, ...]) -> bool:
    """Return whether texts are different and none of them is empty."""
    return all(text.strip() for text in texts) and len(set(texts)) == len(texts)


@dataclass(frozen=True)
class Wheel:
    """One wheel with its drive; all six are the same."""

    radius: Size
    """Radius in [m]."""
    width: Size
    """Width of the tread in [m]."""
    mass: Mass
    """Mass with drive in [kg]."""
    max_torque: Annotated[float, number("N m", least=known.MIN_TORQUE, most=known.MAX_TORQUE)]
    """Largest torque of the drive in [N m]."""
    max_speed: Annotated[float, number("rad/s", least=known.MIN_SPEED, most=known.MAX_SPEED)]
    """Largest speed of the drive in [rad/s]."""
    servo_droop: Annotated[float, number("", least=0.0, below=1.0)] = DEFAULT_SERVO_DROOP
    """Share of the commanded speed that the drive's servo loses at full torque; 0 is stiff."""
    torque_per_current: (
        Annotated[float, number("N m/A", least=known.MIN_TORQUE, most=known.MAX_TORQUE)] | None
    ) = None
    """Torque at the wheel over the motor's current in [N m/A], for logs of currents; None if it is
    not known."""


@dataclass(frozen=True)
class Steering:
    """Wheels that turn about the z axis of their link, in pairs: both wheels of an axle."""

    wheels: Annotated[
        tuple[str, ...],
        Rule(
            f"a list of one or more of {', '.join(WHEEL_POSITIONS)}, each once", holds=_are_axles
        ),
    ]
    """Positions of the wheels that turn: ``"rear"``, ``"middle"``, ``"front"``."""
    limit: Annotated[float, number("rad", least=known.MIN_STEERING, most=math.pi)]
    """Largest steering angle to either side in [rad]."""
    rate: Annotated[float, number("rad/s", least=known.MIN_SPEED, most=known.MAX_SPEED)]
    """Largest speed of the steering in [rad/s]."""


@dataclass(frozen=True)
class Suspension:
    """Pivots and wheel centres of the left side on flat ground, body frame, [m]."""

    rocker_pivot: Point
    """Pivot of the rocker on the body; the body origin is midway between both pivots."""
    bogie_pivot: Point
    """Pivot of the bogie on the rocker."""
    rocker_wheel: Annotated[str, choice("rear", "front")]
    """The wheel on the rocker itself, ``"rear"`` or ``"front"``; the others are on the bogie."""
    wheels: Annotated[dict[str, Point], Keys(dict.fromkeys(WHEEL_POSITIONS, Point))]
    """Wheel centres, keys ``"rear"``, ``"middle"``, ``"front"``."""
    rocker_limits: Angles
    """Lowest and highest rocker angle in [rad]."""
    bogie_limits: Angles
    """Lowest and highest bogie angle in [rad]."""

    @property
    def bogie_wheels(self) -> tuple[str, str]:
        """Names of the two wheels on the bogie, rear to front."""
        return ("middle", "front") if self.rocker_wheel == "rear" else ("rear", "middle")


@dataclass(frozen=True)
class Part:
    """A rigid part."""

    mass: Mass
    """Mass in [kg]."""
    com: Point
    """Centre of mass in [m], body frame, left side, flat ground."""


@dataclass(frozen=True)
class Masses:
    """The parts with mass, without the wheels."""

    body: Part
    """The body with everything on it, including the stowed manipulator."""
    rocker: Part
    """One rocker, without its wheel."""
    bogie: Part
    """One bogie, without its wheels."""


@dataclass(frozen=True)
class Belly:
    """The underside of the body: a rectangle in the body frame."""

    z: Metres
    """Height in [m]."""
    x: Edges
    """Rear and front edge in [m]."""
    y: Edges
    """Right and left edge in [m]."""


@dataclass(frozen=True)
class Limits:
    """Safety limits for the verdict on a path."""

    tilt: Annotated[float, number("rad", above=0.0, most=1.57)]
    """Largest angle between body z and the vertical in [rad]."""
    tip_over_ratio: Annotated[float, number("", least=0.0, most=1.0)]
    """Smallest tip-over angle relative to the one on flat ground."""
    friction_utilisation: Share
    """Largest friction utilisation of a wheel."""
    torque_saturation: Share
    """Largest torque saturation of a wheel: |torque| over the drive's largest torque."""
    belly_clearance: Annotated[float, number("m", least=0.0, most=known.MAX_COORDINATE)]
    """Smallest height of the belly over the ground in [m]."""
    wheel_drop: Annotated[float, number("m", least=0.0, most=known.MAX_COORDINATE)]
    """Largest height that a wheel may drop when it rolls off an edge in [m]."""
    further: Annotated[dict[str, float], Keys({})] = field(default_factory=dict)
    """Numbers of limits that a rover file may leave out, by the keys of the table of limits; in a
    file they stand beside the others."""


@dataclass(frozen=True)
class Manipulator:
    """An arm of three joints: base yaw about z, shoulder and elbow about y.

    At zero joint angles the column stands up from the base along +z, upper arm and forearm point
    forward along +x. Angles are right-handed: positive shoulder and elbow lower the arm.
    """

    base: Point
    """Foot of the column in [m], body frame."""
    joints: Annotated[tuple[str, str, str], Rule("a list of 3 different names", holds=_are_names)]
    """Names of base yaw, shoulder and elbow in ``joint_states``."""
    link_lengths: Annotated[
        tuple[Metres, Metres, Metres],
        Rule("a list of 3 numbers in m, none of them negative, the arm not 0", holds=_is_arm),
    ]
    """Column, upper arm and forearm in [m]."""
    link_masses: Annotated[
        tuple[Mass, Mass, Mass], Rule("a list of 3 numbers in kg, none of them negative")
    ]
    """Masses of column, upper arm and forearm in [kg], each at the middle of its link."""
    stowed: Annotated[tuple[Radians, Radians, Radians], Rule("a list of 3 numbers in rad")]
    """Joint angles of the stowed pose in [rad]; the body's centre of mass holds for this pose."""
    payload: Mass = 0.0
    """Mass at the tip in [kg]."""
    joint_limits: (
        Annotated[
            tuple[Angles, Angles, Angles],
            Rule("a list of 3 intervals [lowest, highest] in rad, each first below its second"),
        ]
        | None
    ) = None
    """Lowest and highest angle of each joint in [rad]; None: no limits."""


@dataclass(frozen=True)
class Rover:
    """A rocker-bogie rover: geometry [m], masses [kg], wheels, limits, arm and uncertainty.

    `load_rover` reads one from a rover file and checks it (docs/conventions.md has its frames).
    """

    name: Text
    """Name of the rover."""
    gravity: Annotated[float, number("m/s^2", least=known.MIN_GRAVITY, most=known.MAX_GRAVITY)]
    """Acceleration of gravity in [m/s^2]."""
    wheel: Wheel
    """Each of the six wheels."""
    suspension: Suspension
    """Pivots, wheel centres and joint limits."""
    masses: Masses
    """Body, rockers and bogies."""
    belly: Belly
    """Underside of the body, for its clearance."""
    friction: Annotated[float, number("", least=known.MIN_FRICTION, most=known.MAX_FRICTION)]
    """Coulomb friction coefficient where the terrain has none."""
    nominal_speed: Speed
    """Driving speed in [m/s]."""
    limits: Limits
    """Safety limits."""
    manipulator: Manipulator | None = None
    """The arm; None if there is none."""
    steering: Steering | None = None
    """The wheels that steer; None if all are fixed, and the rover skids in curves."""
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    """Standard deviations of friction, torques, masses and pose, for chances of failure."""

    @property
    def total_mass(self) -> float:
        """Mass in [kg] of body, two rockers, two bogies and six wheels, without payload."""
        masses = self.masses
        sides = 2.0 * (masses.rocker.mass + masses.bogie.mass)
        return masses.body.mass + sides + 6.0 * self.wheel.mass

    @property
    def wheelbase(self) -> float:
        """Distance from rear to front wheels in [m]."""
        wheels = self.suspension.wheels
        return float(wheels["front"][0] - wheels["rear"][0])

    @property
    def weight(self) -> float:
        """Weight of the whole rover in [N], without payload."""
        return self.total_mass * self.gravity
