"""The clock of the page: play, pause, step, rewind and fast forward at a chosen speed."""

from dataclasses import dataclass

import numpy as np

SPEEDS = (1, 2, 5, 10, 20, 50, 100)
"""Speeds to choose from, in seconds of the drive per second of the visitor."""
FAST = 4.0
"""Rate of fast forward and, backwards, of rewind."""


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
    """Factor on the speed: 0 paused, 1 playing, FAST and -FAST fast forward and rewind."""

    def play(self) -> None:
        """Play from the shown time, or from the start if that is the end."""
        if self.time >= self.duration:
            self.time = 0.0
        self.rate = 1.0

    def pause(self) -> None:
        """Stop at the shown time."""
        self.rate = 0.0

    def fast_forward(self) -> None:
        """Play faster."""
        self.rate = FAST

    def rewind(self) -> None:
        """Play backwards, faster."""
        self.rate = -FAST

    def seek(self, time: float) -> None:
        """Go to a time [s], limited to the drive."""
        self.time = float(np.clip(time, 0.0, self.duration))

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
        word = {1.0: "playing", FAST: "fast forward", -FAST: "rewinding"}[self.rate]
        return f"{word}, {abs(self.rate) * self.speed:g} times as fast as the rover"

    def set_duration(self, duration: float) -> None:
        """Take the duration of another drive [s], at the same share of it."""
        share = self.time / self.duration if self.duration > 0.0 else 0.0
        self.duration = duration
        self.seek(share * duration)
