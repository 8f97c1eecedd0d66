# SPDX-License-Identifier: Apache-2.0
"""The clock of the page: play, pause, step and rewind at a chosen speed."""

from dataclasses import dataclass, field

import numpy as np

from rover_physics.numerics.arrays import Floats

SPEEDS = (1, 2, 5, 10, 20, 50, 100)
"""Speeds to choose from, in seconds of the drive per second of the visitor."""
FAST = 4.0
"""Rate of rewind, backwards."""


@dataclass
class Playback:
    """The time of a drive that is shown, and how it moves on."""

    duration: float = 0.0
    """Duration of the drive [s]."""
    time: float = 0.0
    """Time that is shown [s]."""
    speed: float = 10.0
    """Chosen speed, one of SPEEDS."""
    rate: float = 0.0
    """Factor on the speed: 0 paused, 1 playing, -FAST rewinding."""

    _times: Floats = field(default_factory=lambda: np.zeros(1))
    _distance: Floats = field(default_factory=lambda: np.zeros(1))
    _kept: tuple[float, float] | None = None
    """Where the rover is by `set_drive` until the time is moved: distance [m], and the time it
    has turned there [s]; None if the time tells."""

    def toggle(self) -> None:
        """Play if it is paused, else pause."""
        if self.rate == 0.0:
            self.play()
        else:
            self.pause()

    def play(self) -> None:
        """Play from the shown time, or from the start if that is the end."""
        if self.time >= self.duration:
            self.seek(0.0)
        self.rate = 1.0

    def pause(self) -> None:
        """Stop at the shown time."""
        self.rate = 0.0

    def rewind(self) -> None:
        """Play backwards, faster."""
        self.rate = -FAST

    def seek(self, time: float) -> None:
        """Go to a time [s], limited to the drive."""
        self.time = float(np.clip(time, 0.0, self.duration))
        self._kept = None

    def go_to(self, time: float) -> None:
        """Pause, and go to a time [s], limited to the drive."""
        self.pause()
        self.seek(time)

    def step(self, times: np.ndarray, by: int = 1) -> None:
        """Pause, and go to the next of `times` (n,) [s], or to the previous one if `by` is -1."""
        self.pause()
        if by > 0:
            index = int(np.searchsorted(times, self.time + 1e-9, side="right"))
        else:
            index = int(np.searchsorted(times, self.time - 1e-9, side="left")) - 1
        self.seek(float(times[np.clip(index, 0, len(times) - 1)]))

    def advance(self, seconds: float) -> bool:
        """Move on by the visitor's time [s]; return whether the shown time may have changed."""
        if self.rate == 0.0:
            return False
        self.seek(self.time + self.rate * self.speed * seconds)
        if self.time == (self.duration if self.rate > 0.0 else 0.0):
            self.pause()
        return True

    def describe(self) -> str:
        """Return how it moves, in words."""
        if self.rate == 0.0:
            return "paused"
        word = "playing" if self.rate > 0.0 else "rewinding"
        return f"{word}, {abs(self.rate) * self.speed:g} times as fast as the rover"

    def set_drive(self, times: Floats, distance: Floats) -> None:
        """Take another drive and go to the place where the rover is: the same distance driven.

        A drive that ends before that place is shown at its end, and the place is kept for the
        next one until the time is moved.

        Args:
            times: (n,) times of its waypoints [s], ascending, n >= 1.
            distance: (n,) distances driven there [m], ascending.
        """
        if self._kept is not None:
            driven, turning = self._kept
        else:
            driven = float(np.interp(self.time, self._times, self._distance))
            turning = max(self.time - _first_time_at(self._times, self._distance, driven), 0.0)
        self._times, self._distance = times, distance
        self.duration = float(times[-1])
        arrival = _first_time_at(times, distance, driven)
        departure = float(times[np.searchsorted(distance, driven, side="right") - 1])
        self.seek(min(arrival + turning, max(arrival, departure)))
        self._kept = driven, turning


def _first_time_at(times: Floats, distance: Floats, driven: float) -> float:
    """Return the first time at which a distance was driven, at most the last time [s]."""
    after = min(int(np.searchsorted(distance, driven, side="left")), len(times) - 1)
    if after == 0:
        return float(times[0])
    pair = slice(after - 1, after + 1)
    return float(np.interp(driven, distance[pair], times[pair]))
