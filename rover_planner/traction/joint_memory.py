# SPDX-License-Identifier: Apache-2.0
"""Merges joint states of several publishers: each joint keeps its last value and its time."""

import math
from collections.abc import Mapping

import numpy as np

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import steering_joints
from rover_planner.traction.input_monitor import NEVER

MAX_WHEEL_RATE_RATIO = 20.0
"""Largest possible wheel rate, over the drive's largest; a rover that rolls down a slope is
faster than its drives."""
MAX_TURNING_RATE = 20.0
"""Largest possible rate of the body, a rocker or a bogie [rad/s]."""
ANGLE_MARGIN = 0.5
"""Angle beyond the limit of a suspension or steering joint that is possible [rad]."""
_SUSPENSION, _WHEELS = len(SUSPENSION_JOINTS), len(WHEEL_JOINTS)


class JointMemory:
    """Keeps positions of suspension and steering, and velocities of suspension and wheels.

    Each value has a time [s] and a header stamp [ns] of its own; the stamp of messages that have
    none is 0.
    """

    def __init__(self, rover: Rover) -> None:
        """Start without values of the joints of a rover."""
        suspension, fastest = rover.suspension, MAX_WHEEL_RATE_RATIO * rover.wheel.max_speed
        angles = {
            name: suspension.rocker_limits if "rocker" in name else suspension.bogie_limits
            for name in SUSPENSION_JOINTS
        }
        if rover.steering is not None:
            limit = rover.steering.limit
            angles |= dict.fromkeys(steering_joints(rover), (-limit, limit))
        rates = dict.fromkeys(SUSPENSION_JOINTS, (-MAX_TURNING_RATE, MAX_TURNING_RATE))
        rates |= dict.fromkeys(WHEEL_JOINTS, (-fastest, fastest))
        self._bounds = {
            ("position", name): (low - ANGLE_MARGIN, high + ANGLE_MARGIN)
            for name, (low, high) in angles.items()
        } | {("velocity", name): bounds for name, bounds in rates.items()}
        self._places = {kind_and_name: place for place, kind_and_name in enumerate(self._bounds)}
        self._values = np.zeros(len(self._places))
        self._optional = slice(len(angles), len(angles) + _SUSPENSION)
        self.suspension_angles = self._values[:_SUSPENSION]
        """Last angles (4,) of SUSPENSION_JOINTS [rad]; each message writes them anew."""
        self.steering_angles = self._values[_SUSPENSION : len(angles)]
        """The same of the steering joints, in their order."""
        self.wheel_rates = self._values[-_WHEELS:]
        """Last rates (6,) of WHEEL_JOINTS [rad/s]; each message writes them anew."""
        self.forget()

    def find_wrong(self, positions: Mapping[str, float], velocities: Mapping[str, float]) -> str:
        """Describe an angle [rad] or rate [rad/s] that only a broken sensor or driver has."""
        for kind, unit, values in (
            ("position", "rad", positions),
            ("velocity", "rad/s", velocities),
        ):
            for name, value in values.items():
                low, high = self._bounds.get((kind, name), (-math.inf, math.inf))
                if not low <= value <= high:
                    return (
                        f"joint_states has {kind} {value:g} of {name}; it must be in {low:g} to "
                        f"{high:g} {unit}"
                    )
        return ""

    def take(
        self,
        positions: Mapping[str, float],
        velocities: Mapping[str, float],
        time: float,
        stamp: int = 0,
    ) -> bool:
        """Take angles [rad] and rates [rad/s] by name; other joints are ignored.

        A value whose stamp [ns] is not after that of the last one is not taken: the stream is
        frozen, or the message is out of order.

        Returns:
            Whether a joint of the rover got a new value.
        """
        taken = False
        for kind, values in (("position", positions), ("velocity", velocities)):
            for name, value in values.items():
                place = self._places.get((kind, name))
                if place is None or (stamp and stamp <= self._stamps[place]):
                    continue
                self._values[place], self._times[place] = value, time
                self._stamps[place] = max(stamp, self._stamps[place])
                taken = True
        return taken

    def forget(self) -> None:
        """Forget times and stamps: each joint must arrive anew."""
        self._times = [NEVER] * len(self._places)
        self._stamps = [0] * len(self._places)

    @property
    def time(self) -> float:
        """Time of the oldest value that is needed [s]; NEVER if one is missing."""
        return min(*self._times[: self._optional.start], self.wheel_time)

    @property
    def wheel_time(self) -> float:
        """Time of the oldest wheel rate [s]; NEVER if one is missing."""
        return min(self._times[-_WHEELS:])

    def find_suspension_rates(self, earliest: float) -> Floats | None:
        """Return the rates (4,) of SUSPENSION_JOINTS [rad/s]; None if one is older [s]."""
        is_old = min(self._times[self._optional]) < earliest
        return None if is_old else self._values[self._optional].copy()

    def describe_older(self, earliest: float) -> str:
        """Return which needed values are older than a time [s]; empty if none or all are."""
        needed = list(self._places.items())
        del needed[self._optional]
        older = [kind_and_name for kind_and_name, k in needed if self._times[k] < earliest]
        if len(older) == len(needed):
            return ""
        names = {kind: [name for one, name in older if one == kind] for kind, _ in older}
        return ", ".join(f"no {kind} of {', '.join(which)}" for kind, which in names.items())
