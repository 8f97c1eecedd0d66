# SPDX-License-Identifier: Apache-2.0
"""Merges joint states of several publishers: each joint keeps its last value and its time."""

from collections.abc import Mapping, Sequence

import numpy as np

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_planner.traction.input_monitor import NEVER

SUSPENSION, OTHERS = slice(len(SUSPENSION_JOINTS)), slice(len(SUSPENSION_JOINTS), None)
"""Joints of the suspension, which come first, and the others."""


class Readings:
    """The last values of some joints, with times [s] and header stamps [ns] of measurement."""

    def __init__(self, names: Sequence[str]):
        """Start without values; the stamp of messages that have none is 0."""
        self.names = tuple(names)
        self._places = {name: place for place, name in enumerate(names)}
        self.values = np.zeros(len(names))
        self.forget()

    def keep(self, values: Mapping[str, float], time: float, stamp: int) -> bool:
        """Take values by name whose stamp is after the last one; return whether any was."""
        taken = False
        for name, value in values.items():
            place = self._places.get(name)
            if place is None or (stamp and stamp <= self._stamps[place]):
                continue
            self.values[place], self.times[place] = value, time
            self._stamps[place] = max(stamp, self._stamps[place])
            taken = True
        return taken

    def forget(self) -> None:
        """Forget times and stamps: each joint must arrive anew."""
        self.times = [NEVER] * len(self.names)
        self._stamps = [0] * len(self.names)


class JointMemory:
    """Keeps positions of suspension and steering, and velocities of suspension and wheels."""

    def __init__(self, steering: Sequence[str] = ()) -> None:
        """Start without values; `steering` are the names of the rover's steering joints."""
        self._positions = Readings((*SUSPENSION_JOINTS, *steering))
        self._velocities = Readings((*SUSPENSION_JOINTS, *WHEEL_JOINTS))
        self.suspension_angles = self._positions.values[SUSPENSION]
        """Last angles (4,) of SUSPENSION_JOINTS [rad]; each message writes them anew."""
        self.steering_angles = self._positions.values[OTHERS]
        """The same of the steering joints, in their order."""
        self.wheel_rates = self._velocities.values[OTHERS]
        """Last rates (6,) of WHEEL_JOINTS [rad/s]; each message writes them anew."""

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
        taken = self._positions.keep(positions, time, stamp)
        return self._velocities.keep(velocities, time, stamp) or taken

    def forget(self) -> None:
        """Forget times and stamps: each joint must arrive anew."""
        self._positions.forget()
        self._velocities.forget()

    @property
    def time(self) -> float:
        """Time of the oldest value that is needed [s]; NEVER if one is missing."""
        return min(*self._positions.times, self.wheel_time)

    @property
    def wheel_time(self) -> float:
        """Time of the oldest wheel rate [s]; NEVER if one is missing."""
        return min(self._velocities.times[OTHERS])

    @property
    def is_empty(self) -> bool:
        """True if no joint has a value."""
        return max(*self._positions.times, *self._velocities.times) == NEVER

    def find_suspension_rates(self, earliest: float) -> Floats | None:
        """Return the rates (4,) of SUSPENSION_JOINTS [rad/s]; None if one is older [s]."""
        rates = self._velocities
        is_old = min(rates.times[SUSPENSION]) < earliest
        return None if is_old else rates.values[SUSPENSION].copy()

    def describe_older(self, earliest: float) -> str:
        """Return which needed values are older than a time [s]; empty if none or all are."""
        needed = (
            ("position", self._positions.names, self._positions.times),
            ("velocity", self._velocities.names[OTHERS], self._velocities.times[OTHERS]),
        )
        older = [
            (kind, [name for name, time in zip(names, times, strict=True) if time < earliest])
            for kind, names, times in needed
        ]
        if sum(len(names) for _, names in older) == sum(len(names) for _, names, _ in needed):
            return ""
        return ", ".join(f"no {kind} of {', '.join(names)}" for kind, names in older if names)
