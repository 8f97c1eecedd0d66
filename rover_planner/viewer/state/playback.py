# SPDX-License-Identifier: Apache-2.0
"""The clock of the page: play, pause and step at a chosen speed."""

from dataclasses import dataclass, field

import numpy as np

from rover_physics.numerics.arrays import Floats

SPEEDS = (1, 2, 5, 10, 20, 50, 100)
"""Speeds to choose from, in seconds of the drive per second of the visitor."""


@dataclass
class Playback:
    """The time of a drive that is shown, and how it moves on."""

    times: Floats = field(default_factory=lambda: np.zeros(1))
    """(n,) times of the poses of the drive [s]."""
    places: Floats = field(default_factory=lambda: np.zeros(1))
    """(n,) their places along the path, whole numbers at waypoints."""
    time: float = 0.0
    """Time that is shown [s]."""
    speed: float = 10.0
    """Chosen speed, one of SPEEDS."""
    is_playing: bool = False
    """True if the time moves on."""
    moved: bool = True
    """True if it has changed since it was shown; whoever shows it sets this to False."""
    _place: float | None = None
    """Where the rover is by `set_drive` until the time is moved; None if the time tells."""

    @property
    def duration(self) -> float:
        """Duration of the drive [s]."""
        return float(self.times[-1])

    def toggle(self) -> None:
        """Pause if it plays; else play, from the start if the shown time is the end."""
        self.is_playing, self.moved = not self.is_playing, True
        if self.is_playing and self.time >= self.duration:
            self.seek(0.0)

    def seek(self, time: float) -> None:
        """Go to a time [s], limited to the drive."""
        self.time = float(np.clip(time, 0.0, self.duration))
        self._place, self.moved = None, True

    def go_to(self, time: float) -> None:
        """Pause, and go to a time [s], limited to the drive."""
        self.is_playing = False
        self.seek(time)

    def step(self, by: int = 1) -> None:
        """Pause, and go to the next pose, or to the previous one if `by` is -1."""
        if by > 0:
            index = int(np.searchsorted(self.times, self.time + 1e-9, side="right"))
        else:
            index = int(np.searchsorted(self.times, self.time - 1e-9, side="left")) - 1
        self.go_to(float(self.times[np.clip(index, 0, len(self.times) - 1)]))

    def advance(self, seconds: float) -> None:
        """Move on by the visitor's time [s] if it plays."""
        if self.is_playing:
            self.seek(self.time + self.speed * seconds)
            self.is_playing = self.time < self.duration

    def describe(self) -> str:
        """Return how it moves, in words."""
        return (
            f"playing, {self.speed:g} times as fast as the rover" if self.is_playing else "paused"
        )

    def set_drive(self, times: Floats, places: Floats) -> None:
        """Take another drive, and go to the place where the rover is.

        A drive that ends before that place is shown at its end, and the place is kept for the
        next one until the time is moved.

        Args:
            times: (n,) times of its poses [s], ascending, n >= 1.
            places: (n,) their places along the path, ascending.
        """
        place = self._place
        if place is None:
            place = float(np.interp(self.time, self.times, self.places))
        self.times, self.places = times, places
        self.seek(float(np.interp(place, places, times)))
        self._place = place
