# SPDX-License-Identifier: Apache-2.0
"""Merges joint states of several publishers: each joint keeps its last value and its time."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_planner.traction.input_monitor import NEVER


class Reading(NamedTuple):
    """The last value of a joint."""

    value: float
    """Angle [rad] or rate [rad/s]."""
    time: float
    """Time of the measurement [s]."""
    stamp: int
    """Last header stamp [ns]; 0 if no message had one."""


NOT_READ = Reading(0.0, NEVER, 0)


class JointMemory:
    """Keeps positions of suspension and steering, and velocities of suspension and wheels."""

    def __init__(self, steering: Sequence[str] = ()) -> None:
        """Start without values; `steering` are the names of the rover's steering joints."""
        self._steering = tuple(steering)
        self._positions = dict.fromkeys((*SUSPENSION_JOINTS, *steering), NOT_READ)
        self._velocities = dict.fromkeys((*SUSPENSION_JOINTS, *WHEEL_JOINTS), NOT_READ)

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
        taken = _keep(self._positions, positions, time, stamp)
        return _keep(self._velocities, velocities, time, stamp) or taken

    def forget(self) -> None:
        """Forget times and stamps: each joint must arrive anew."""
        for kept in (self._positions, self._velocities):
            for name, reading in kept.items():
                kept[name] = reading._replace(time=NEVER, stamp=0)

    @property
    def time(self) -> float:
        """Time of the oldest value that is needed [s]; NEVER if one is missing."""
        angles = min(reading.time for reading in self._positions.values())
        return min(angles, self.wheel_time)

    @property
    def wheel_time(self) -> float:
        """Time of the oldest wheel rate [s]; NEVER if one is missing."""
        return min(self._velocities[name].time for name in WHEEL_JOINTS)

    @property
    def is_empty(self) -> bool:
        """Whether no joint has a value."""
        readings = (*self._positions.values(), *self._velocities.values())
        return all(reading.time == NEVER for reading in readings)

    @property
    def suspension_angles(self) -> Floats:
        """Angles (4,) of SUSPENSION_JOINTS [rad]."""
        return np.array([self._positions[name].value for name in SUSPENSION_JOINTS])

    @property
    def steering_angles(self) -> list[float]:
        """Angles of the steering joints, in their order [rad]."""
        return [self._positions[name].value for name in self._steering]

    @property
    def wheel_rates(self) -> Floats:
        """Rates (6,) of WHEEL_JOINTS [rad/s]."""
        return np.array([self._velocities[name].value for name in WHEEL_JOINTS])

    def find_suspension_rates(self, earliest: float) -> Floats | None:
        """Return the rates (4,) of SUSPENSION_JOINTS [rad/s]; None if one is older [s]."""
        readings = [self._velocities[name] for name in SUSPENSION_JOINTS]
        if any(reading.time < earliest for reading in readings):
            return None
        return np.array([reading.value for reading in readings])

    def describe_older(self, earliest: float) -> str:
        """Return which needed values are older than a time [s]; empty if none or all are."""
        angles = [name for name, last in self._positions.items() if last.time < earliest]
        rates = [name for name in WHEEL_JOINTS if self._velocities[name].time < earliest]
        if len(angles) + len(rates) == len(self._positions) + len(WHEEL_JOINTS):
            return ""
        return ", ".join((*_list("position", angles), *_list("velocity", rates)))


def _list(what: str, names: list[str]) -> Iterable[str]:
    return [f"no {what} of {', '.join(names)}"] if names else []


def _keep(kept: dict[str, Reading], values: Mapping[str, float], time: float, stamp: int) -> bool:
    taken = False
    for name, value in values.items():
        last = kept.get(name)
        if last is None or (stamp and stamp <= last.stamp):
            continue
        kept[name] = Reading(value, time, max(stamp, last.stamp))
        taken = True
    return taken
