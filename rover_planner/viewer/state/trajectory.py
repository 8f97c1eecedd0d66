# SPDX-License-Identifier: Apache-2.0
"""A predicted path over time: the state of the rover at any time of the drive."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rover_physics.names import SERVO, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.traversability.verdict import Verdict

MAX_SLIP = 0.95
"""Slip ratio at which the shown rate of a wheel is limited."""
MAX_VALUE = 1e6
"""Largest magnitude that is shown: a wheel that lifts off has infinite friction utilisation."""
PLACES = ("position", "wheel_centres", "contact_points")
"""Fields that are places: the northing of a map may be larger."""


@dataclass(frozen=True, eq=False)
class RoverState:
    """The rover at one time; wheels in wheel order, sides right and left."""

    time: float
    """Time since the start [s]."""
    distance: float
    """Distance driven since the start [m]."""
    energy: float
    """Energy spent since the start [J]."""
    speed: float
    """Speed along the path [m/s]."""
    position: Floats
    """(3,) body origin [m], map frame."""
    attitude: Floats
    """(3,) roll, pitch, yaw [rad]."""
    rocker_angle: Floats
    """(2,) [rad]."""
    bogie_angle: Floats
    """(2,) [rad]."""
    steering_angle: Floats
    """(6,) angles of the wheels about the z axes of their links [rad], positive to the left."""
    motion: Floats
    """(3,) motion of the body: forward and to the left [m/s], yaw rate [rad/s]."""
    spin: Floats
    """(6,) angles by which the wheels have turned [rad]."""
    wheel_centres: Floats
    """(6, 3) [m], map frame."""
    contact_points: Floats
    """(6, 3) [m], map frame."""
    wheel_loads: Floats
    """(6,) normal forces N [N]."""
    tangential: Floats
    """(6,) tractions T [N]."""
    lateral: Floats
    """(6,) lateral forces S [N]."""
    friction_use: Floats
    """(6,) friction utilisation over its limit."""
    torque_use: Floats
    """(6,) torque saturation over its limit."""
    slip_ratio: Floats
    """(6,)"""
    tip_over_ratio: float
    """Stability margin: tip-over angle now / on flat ground."""
    belly_clearance: float
    """[m]"""


class Trajectory:
    """The states along a prediction, up to the first failure."""

    def __init__(self, rover: Rover, prediction: PathPrediction, verdict: Verdict):
        """Take the waypoints that settle, up to and including the first failure."""
        self.verdict = verdict
        self.prediction = prediction
        unsettled = np.flatnonzero(~prediction.settled)
        end = int(unsettled[0]) if unsettled.size else len(prediction.poses)
        if verdict.first_failure >= 0:
            end = min(end, verdict.first_failure + 1)
        self.length = end
        """Number of waypoints; 0 where the rover does not settle at the start."""
        self._series = dict.fromkeys(("time", "distance", "energy"), np.zeros(1))
        if end:
            self._series = _read_drive(rover, prediction.select(slice(end)))

    @property
    def has_slip(self) -> bool:
        """True if slip is predicted: on yielding soil, or with speed servos."""
        prediction = self.prediction
        return prediction.policy == SERVO or bool(np.any(prediction.sinkage > 0.0))

    @property
    def times(self) -> Floats:
        """(length,) times of the waypoints [s]; the start alone without waypoints."""
        return self._series["time"]

    @property
    def distance(self) -> Floats:
        """(length,) distances driven at the waypoints [m]; as many as times."""
        return self._series["distance"]

    @property
    def duration(self) -> float:
        """Time from the first waypoint to the last [s]."""
        return float(self.times[-1])

    def series(self, name: str) -> Floats:
        """Return the values of a field of `RoverState` at all waypoints, (length, ...)."""
        return self._series[name]

    def state_at(self, time: float) -> RoverState | None:
        """Return the state at a time [s], linear between waypoints; None without waypoints."""
        if not self.length:
            return None
        times = self.times
        after = int(np.clip(np.searchsorted(times, time), 1, max(len(times) - 1, 1)))
        before = min(after - 1, len(times) - 1)
        after = min(after, len(times) - 1)
        span = times[after] - times[before]
        share = float(np.clip((time - times[before]) / span, 0.0, 1.0)) if span > 0.0 else 0.0
        return make_state(
            {
                n: (1.0 - share) * rows[before] + share * rows[after]
                for n, rows in self._series.items()
            }
        )


def _read_drive(rover: Rover, driven: PathPrediction) -> dict[str, Floats]:
    """Return the values (n, ...) of each field of `RoverState`."""
    moves = np.linalg.norm(np.diff(driven.wheel_centres, axis=0), axis=2)
    rolled = moves / rover.wheel.radius / (1.0 - np.clip(driven.slip_ratio, 0, MAX_SLIP))[1:]
    rolled *= np.where(driven.wheel_speed[1:] < 0.0, -1.0, 1.0)
    spin = np.vstack([np.zeros(6), np.cumsum(np.nan_to_num(rolled), axis=0)])
    return {**read_series(rover, driven), "spin": spin}


def read_series(rover: Rover, prediction: PathPrediction) -> dict[str, Floats]:
    """Return the values (n, ...) of the fields of `RoverState` but for the spin of the wheels."""
    names = [field.name for field in fields(RoverState) if hasattr(prediction, field.name)]
    series = {name: getattr(prediction, name) for name in names}
    yaw = np.unwrap(prediction.poses[:, 2])
    series["attitude"] = np.column_stack([prediction.roll, prediction.pitch, yaw])
    limits, kept = rover.limits, prediction.results["kept_share"][:, None]
    for name, use, bound in (
        ("friction_utilisation", "friction_use", limits.friction_utilisation),
        ("torque_saturation", "torque_use", limits.torque_saturation),
    ):
        series[use] = getattr(prediction, name) / np.maximum(bound * kept, 1e-9)
    series["speed"] = np.hypot(prediction.motion[:, 0], prediction.motion[:, 1])
    return {
        name: values if name in PLACES else np.clip(np.nan_to_num(values), -MAX_VALUE, MAX_VALUE)
        for name, values in series.items()
    }


def make_state(values: dict[str, Any]) -> RoverState:
    """Return the state with the values of all fields, arrays and numbers of numpy."""
    plain: dict[str, Any] = {
        name: float(value) if np.ndim(value) == 0 else value for name, value in values.items()
    }
    return RoverState(**plain)


def find_axles(rover: Rover, state: RoverState) -> Floats:
    """Return the directions (6, 3) of the wheels' axles, map frame, positive to the left."""
    R = matrix_from_xyzw(xyzw_from_rpy(*state.attitude))
    axles = np.empty((6, 3))
    for k, wheel in enumerate(WHEELS):
        side = k // 3
        link = state.rocker_angle[side]
        if not wheel.startswith(rover.suspension.rocker_wheel):
            link = link + state.bogie_angle[side]
        s, c = np.sin(state.steering_angle[k]), np.cos(state.steering_angle[k])
        axles[k] = R @ (-s * np.cos(link), c, s * np.sin(link))
    return axles
