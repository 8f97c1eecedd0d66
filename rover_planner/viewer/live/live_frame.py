"""A rover as its topics tell of it: the latest of everything, as a frame of the page."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.records import new_record
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_planner.viewer.state.journey import Frame

Floats = NDArray[np.float64]


def _unknown() -> Floats:
    return np.full(6, np.nan)


@dataclass
class LiveState:
    """The latest values; NaN for what nothing tells of."""

    position: Floats | None = None
    """(3,) body origin [m], map frame; None before odometry came."""
    attitude: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) roll, pitch, yaw [rad]."""
    speed: float = 0.0
    """[m/s]"""
    joints: dict[str, float] = field(default_factory=dict)
    """Angles [rad] by joint name."""
    efforts: dict[str, float] = field(default_factory=dict)
    """Torques [N m] by joint name."""
    wheel_loads: Floats = field(default_factory=_unknown)
    """(6,) [N]"""
    friction_utilisation: Floats = field(default_factory=_unknown)
    """(6,)"""
    slip_ratio: Floats = field(default_factory=_unknown)
    """(6,)"""
    contact_angles: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) where the wheels touch, from their lowest points [rad]; 0 until something tells."""
    tip_over_ratio: float = math.nan
    """Stability margin."""
    forces_from: str = ""
    """Where the forces come from, empty where nothing tells of them."""
    time: float = 0.0
    """Since the first message [s]."""
    distance: float = 0.0
    """Way since then [m]."""
    energy: float = 0.0
    """Work of the wheels since then [J]."""

    def copy(self) -> "LiveState":
        """Return a copy that no message changes any more."""
        return replace(self, joints=dict(self.joints), efforts=dict(self.efforts))


class LiveFigure:
    """Turns the latest values into a frame, by the rover's own linkage."""

    def __init__(self, rover: Rover):
        """Prepare for a rover."""
        self._rover = rover
        self._linkage = pack_linkage(rover, *body_mass_and_com(rover))
        self._placement = new_record(PLACEMENT)

    def frame(self, state: LiveState) -> Frame | None:
        """Return the frame of a state; None before it is known where the rover is."""
        if state.position is None:
            return None
        angles = [state.joints.get(name, 0.0) for name in SUSPENSION_JOINTS]
        roll, pitch, yaw = state.attitude
        x, y, z = state.position
        q = np.array([z, roll, pitch, 0.5 * (angles[0] - angles[1]), *angles[2:]])
        place(self._linkage, np.array([x, y, yaw]), q, self._placement)
        centres = self._placement.centres.copy()
        radius = self._rover.wheel.radius
        s, c = np.sin(state.contact_angles)[:, None], np.cos(state.contact_angles)[:, None]
        contacts = centres + radius * (s * self._placement.forward - c * self._placement.up)
        torques = np.array([state.efforts.get(name, np.nan) for name in WHEEL_JOINTS])
        return Frame(
            time=state.time,
            distance=state.distance,
            energy=state.energy,
            speed=state.speed,
            position=np.array(state.position),
            attitude=np.array(state.attitude),
            rocker_angle=np.array(angles[:2]),
            bogie_angle=np.array(angles[2:]),
            spin=np.array([state.joints.get(name, 0.0) for name in WHEEL_JOINTS]),
            wheel_centres=centres,
            contact_points=contacts,
            wheel_loads=state.wheel_loads,
            tangential=torques / radius,
            lateral=np.zeros(6),
            friction_utilisation=state.friction_utilisation,
            torque_saturation=np.abs(torques) / self._rover.wheel.max_torque,
            slip_ratio=state.slip_ratio,
            tip_over_ratio=state.tip_over_ratio,
            belly_clearance=float("nan"),
        )
