# SPDX-License-Identifier: Apache-2.0
"""The rover at one time: a prediction of one pose, or what was measured in its place."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.records import new_record
from rover_physics.results.path_prediction import PathPrediction, prediction_of
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_planner.simulator.driving_forces import find_axles

LEAST_BOUND = 1e-9
"""Bound in place of 0 where a use is computed."""


@dataclass(frozen=True, eq=False)
class RoverState:
    """The rover at one time; its attributes are those of a `PathPrediction`, of one pose.

    Such as `wheel_loads` (6,) [N], NaN where they are not known.
    """

    rover: Rover
    """The rover."""
    here: PathPrediction
    """What is predicted or measured, one row."""
    spin: Floats
    """(6,) angles by which the wheels have turned [rad]."""

    def __getattr__(self, name: str) -> Any:
        if name == "here":  # while a copy is made, which has nothing yet
            raise AttributeError(name)
        return getattr(self.here, name)[0]

    @property
    def attitude(self) -> Floats:
        """(3,) roll, pitch, yaw [rad]."""
        return np.array([self.roll, self.pitch, self.here.poses[0, 2]])

    @property
    def axles(self) -> Floats:
        """Directions (6, 3) of the wheels' axles, map frame, positive to the left."""
        on_rocker = self.rover.suspension.rocker_wheel
        return find_axles(self.here, np.array([not w.startswith(on_rocker) for w in WHEELS]))

    @property
    def speed(self) -> float:
        """Speed along the path [m/s]."""
        return float(np.hypot(*self.motion[:2]))

    @property
    def friction_use(self) -> Floats:
        """(6,) friction utilisation over its limit."""
        bound = self.rover.limits.friction_utilisation * self.kept_share
        return np.asarray(self.friction_utilisation / max(bound, LEAST_BOUND))

    @property
    def torque_use(self) -> Floats:
        """(6,) torque saturation over its limit."""
        bound = self.rover.limits.torque_saturation * self.kept_share
        return np.asarray(self.torque_saturation / max(bound, LEAST_BOUND))

    def change(self, **values: Any) -> "RoverState":
        """Return the state with other values of some quantities."""
        return RoverState(self.rover, self.here.change(**values), self.spin)


def place_state(
    rover: Rover,
    position: Floats,
    attitude: Floats,
    joints: Floats | None = None,
    contact_angles: Floats | None = None,
    **known: Any,
) -> RoverState:
    """Return a rover as it is measured, or assumed, to stand; what is not known is NaN.

    Args:
        rover: The rover.
        position: (3,) body origin [m], map frame.
        attitude: (3,) roll, pitch, yaw [rad].
        joints: (4,) right and left rocker and bogie angles [rad] (default: 0).
        contact_angles: (6,) angles of the contacts from the wheels' lowest points [rad]
            (default: 0).
        known: Quantities of a prediction, and `spin` (6,) [rad].
    """
    angles = np.zeros(4) if joints is None else np.asarray(joints)
    contact = np.zeros(6) if contact_angles is None else contact_angles
    (x, y, z), (roll, pitch, yaw) = position, attitude
    placement, pose = new_record(PLACEMENT), np.array([x, y, yaw])
    q = np.array([z, roll, pitch, 0.5 * (angles[0] - angles[1]), *angles[2:]])
    place(pack_linkage(rover, *body_mass_and_com(rover)), pose, q, placement)
    sine, cosine = np.sin(contact)[:, None], np.cos(contact)[:, None]
    down = sine * placement.forward - cosine * placement.up
    values = {
        "position": position, "roll": roll, "pitch": pitch, "rocker_angle": angles[:2],
        "bogie_angle": angles[2:], "steering_angle": placement.steering, "motion": np.zeros(3),
        "wheel_centres": placement.centres,
        "contact_points": placement.centres + rover.wheel.radius * down, **known,
    }  # fmt: skip
    spin = np.asarray(values.pop("spin", np.zeros(6)))
    rows = {name: np.asarray(value, float)[None] for name, value in values.items()}
    status: NDArray[np.int8] = np.array([PoseStatus.SETTLED], np.int8)
    return RoverState(rover, prediction_of(pose[None], status, rows, "measured"), spin)
