"""A predicted path as a journey: what the rover looks like and feels at any time of it."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.traversability.verdict import Verdict

Floats = NDArray[np.float64]
MAX_SLIP = 0.95
"""Slip at which a turning wheel is shown as turning no faster."""


@dataclass(frozen=True, eq=False)
class Frame:
    """The rover at one time; wheels in wheel order, sides right and left."""

    time: float
    """Time since the start [s]."""
    distance: float
    """Way since the start [m]."""
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
    spin: Floats
    """(6,) how far the wheels have turned [rad]."""
    wheel_centres: Floats
    """(6, 3) [m]."""
    contact_points: Floats
    """(6, 3) [m]."""
    wheel_loads: Floats
    """(6,) [N]."""
    tangential: Floats
    """(6,) [N]."""
    lateral: Floats
    """(6,) [N]."""
    friction_utilisation: Floats
    """(6,)"""
    torque_saturation: Floats
    """(6,)"""
    slip_ratio: Floats
    """(6,)"""
    tip_over_ratio: float
    """Stability margin."""
    belly_clearance: float
    """[m]"""


class Journey:
    """A prediction up to where the rover gets, that tells the frame at any time."""

    def __init__(self, rover: Rover, prediction: PathPrediction, verdict: Verdict):
        """Take the waypoints that settle before the first failure, that one included."""
        self.verdict = verdict
        self.prediction = prediction
        stuck = np.flatnonzero(~prediction.settled)
        end = int(stuck[0]) if stuck.size else len(prediction.poses)
        if verdict.first_failure >= 0:
            end = min(end, verdict.first_failure + 1)
        self.length = end
        """Number of waypoints that the journey has; 0 where the start itself fails."""
        self._series = self._collect(rover, prediction, end) if end else {}

    def _collect(self, rover: Rover, prediction: PathPrediction, n: int) -> dict[str, Floats]:
        yaw = np.unwrap(prediction.poses[:n, 2])
        series = {
            field.name: getattr(prediction, field.name)[:n]
            for field in fields(Frame)
            if hasattr(prediction, field.name)
        }
        series["attitude"] = np.column_stack([prediction.roll[:n], prediction.pitch[:n], yaw])
        moves = np.linalg.norm(np.diff(prediction.wheel_centres[:n], axis=0), axis=2)
        rolled = (
            moves / rover.wheel.radius / (1.0 - np.clip(series["slip_ratio"], 0, MAX_SLIP))[1:]
        )
        series["spin"] = np.vstack([np.zeros(6), np.cumsum(np.nan_to_num(rolled), axis=0)])
        series["speed"] = np.full(n, rover.nominal_speed)
        # A wheel that lifts off needs infinite friction; no picture can show more than this.
        return {name: np.clip(np.nan_to_num(values), -1e6, 1e6) for name, values in series.items()}

    @staticmethod
    def empty_times() -> Floats:
        """Return the times of a journey that has not begun."""
        return np.zeros(1)

    @property
    def times(self) -> Floats:
        """(length,) times of the waypoints [s]."""
        return self._series["time"] if self.length else self.empty_times()

    @property
    def duration(self) -> float:
        """Length of the journey [s]."""
        return float(self.times[-1])

    def series(self, name: str) -> Floats:
        """Return the values of a field of `Frame` at all waypoints, (length, ...)."""
        return self._series[name]

    def frame(self, time: float) -> Frame | None:
        """Return the frame at a time [s], in proportion between waypoints; None if none."""
        if not self.length:
            return None
        times = self.times
        after = int(np.clip(np.searchsorted(times, time), 1, max(len(times) - 1, 1)))
        before = min(after - 1, len(times) - 1)
        after = min(after, len(times) - 1)
        span = times[after] - times[before]
        share = float(np.clip((time - times[before]) / span, 0.0, 1.0)) if span > 0.0 else 0.0
        values: dict[str, Any] = {}
        for name, rows in self._series.items():
            value = (1.0 - share) * rows[before] + share * rows[after]
            values[name] = float(value) if np.ndim(value) == 0 else value
        return Frame(**values)
