"""The rover: geometry, masses, actuators and safety limits."""

from dataclasses import dataclass

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
