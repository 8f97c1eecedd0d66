# SPDX-License-Identifier: Apache-2.0
"""The drive along a predicted path: the rover at any time of it, and the clock that plays it."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction, prediction_of
from rover_physics.results.record import RESULT, numbers_of
from rover_physics.rover.linkage import pack_linkage
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_planner.maps.ground_beneath import Standing
from rover_planner.planning.asked_poses import AskedPoses
from rover_planner.simulator.driving_forces import find_axles

LEAST_BOUND = 1e-9
"""Bound in place of 0 where a use is computed."""
MAX_SLIP = 0.95
"""Slip ratio at which the shown rate of a wheel is limited."""
MAX_VALUE = 1e9
"""Largest magnitude that is shown: a wheel that lifts off has infinite friction utilisation."""
SPEEDS = (1, 2, 5, 10, 20, 50, 100)
"""Speeds to choose from, in seconds of the drive per second of the visitor."""


@dataclass(frozen=True, eq=False)
class RoverState:
    """The rover at one time; its attributes are those of a `PathPrediction`, of one pose.

    Such as `wheel_loads` (6,) [N], NaN where they are not known.
    """

    rover: Rover
    """The rover."""
    here: PathPrediction
    """Prediction or measurement, one row."""
    spin: Floats
    """(6,) angles by which the wheels have turned [rad]."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.here, name)[0]

    @property
    def attitude(self) -> Floats:
        """(3,) roll, pitch, yaw [rad]."""
        return np.array([self.roll, self.pitch, self.here.poses[0, 2]])

    @property
    def axles(self) -> Floats:
        """Directions (6, 3) of the wheels' axles, map frame, positive to the left."""
        return find_axles(pack_linkage(self.rover), self.here)

    @property
    def friction_use(self) -> Floats:
        """(6,) friction utilisation over its limit."""
        return self._use(self.friction_utilisation, self.rover.limits.friction_utilisation)

    @property
    def torque_use(self) -> Floats:
        """(6,) torque saturation over its limit."""
        return self._use(self.torque_saturation, self.rover.limits.torque_saturation)

    def _use(self, values: Floats, limit: float) -> Floats:
        return np.asarray(values / max(limit * self.kept_share, LEAST_BOUND))


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
    standing = Standing(np.array([*position, *attitude]), angles)
    placement, (roll, pitch, _) = standing.place(rover), attitude
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
    return RoverState(
        rover, prediction_of(standing.pose[None, [0, 1, 5]], status, rows, "measured"), spin
    )


class Trajectory:
    """The drive along a path: the poses at which the model was asked, up to the first failure."""

    def __init__(self, rover: Rover, rows: AskedPoses):
        """Take the poses that settle, of those up to and including the first failure."""
        unsettled = np.flatnonzero(~rows.prediction.settled)
        end = int(unsettled[0]) if unsettled.size else len(rows.place)
        self.length = end
        """Number of poses; 0 where the rover does not settle at the start."""
        shown = slice(max(end, 1))
        self.places, self.distance, self.times = (
            rows.place[shown], rows.distance[shown], rows.time[shown]
        )  # fmt: skip
        """Places as in `AskedPoses`, distances [m] and times [s] of the poses; without poses those
        of the start."""
        self._rover, self._driven = rover, rows.prediction.select(slice(end))
        self.energy = float(self._driven.energy[-1]) if end else 0.0
        """Energy spent up to its end [J]."""
        self._yaw = np.unwrap(self._driven.poses[:, 2])
        self._numbers = np.clip(numbers_of(self._driven.results), -MAX_VALUE, MAX_VALUE)
        moves = np.linalg.norm(np.diff(self._driven.wheel_centres, axis=0), axis=2)
        slip = np.clip(self._driven.slip_ratio, 0, MAX_SLIP)[1:]
        rolled = moves / rover.wheel.radius / (1.0 - slip)
        rolled *= np.where(self._driven.wheel_speed[1:] < 0.0, -1.0, 1.0)
        self._spin = np.vstack([np.zeros(6), np.cumsum(np.nan_to_num(rolled), axis=0)])
        """Angles (length, 6) by which the wheels have turned [rad]."""

    def time_at(self, distance: float) -> float:
        """Return the time at which the rover is at a distance [m]."""
        return float(np.interp(distance, self.distance, self.times))

    def state_at(self, time: float) -> RoverState | None:
        """Return the state at a time [s], linear between poses; None without poses."""
        if not self.length:
            return None
        place = float(np.interp(time, self.times, np.arange(self.length)))
        before = int(place)
        rows, shares = [before, min(before + 1, self.length - 1)], [1.0 - place % 1.0, place % 1.0]
        poses = self._driven.poses[rows].copy()
        poses[:, 2] = self._yaw[rows]
        results = (shares @ self._numbers[rows])[None].view(RESULT)[:, 0]
        results["status"] = PoseStatus.SETTLED
        here = replace(
            self._driven.select([before]), poses=(shares @ poses)[None], results=results
        )
        return RoverState(self._rover, here, np.asarray(shares @ self._spin[rows]))


@dataclass
class Playback:
    """The time of a drive that is shown, and how it moves on."""

    drive: Trajectory
    """The drive; with another, the rover stays at its place, or at the end if it ends before."""
    place: float = 0.0
    """Where the rover is along the path."""
    speed: float = 10.0
    """Chosen speed, one of SPEEDS."""
    is_playing: bool = False
    """True if the time moves on."""
    moved: bool = True
    """True if it has changed since it was shown; whoever shows it sets this to False."""

    @property
    def time(self) -> float:
        """Time that is shown [s]."""
        return float(np.interp(self.place, self.drive.places, self.drive.times))

    @property
    def duration(self) -> float:
        """Duration of the drive [s]."""
        return float(self.drive.times[-1])

    def toggle(self) -> None:
        """Pause if it plays; else play, from the start if the shown time is the end."""
        self.is_playing, self.moved = not self.is_playing, True
        if self.is_playing and self.time >= self.duration:
            self.seek(0.0)

    def seek(self, time: float) -> None:
        """Go to a time [s], limited to the drive."""
        self.place, self.moved = float(np.interp(time, self.drive.times, self.drive.places)), True

    def go_to(self, time: float) -> None:
        """Pause, and go to a time [s], limited to the drive."""
        self.is_playing = False
        self.seek(time)

    def step(self, by: int = 1) -> None:
        """Pause, and go to the next pose, or to the previous one if `by` is -1."""
        times, now = self.drive.times, self.time
        before = np.count_nonzero(times < now - 1e-9)
        index = np.count_nonzero(times <= now + 1e-9) if by > 0 else before - 1
        self.go_to(float(times[np.clip(index, 0, len(times) - 1)]))

    def advance(self, seconds: float) -> None:
        """Move on by the visitor's time [s] if it plays."""
        if self.is_playing:
            self.seek(self.time + self.speed * seconds)
            self.is_playing = self.time < self.duration
