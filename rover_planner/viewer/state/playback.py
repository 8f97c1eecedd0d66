"""The clock of the page: play, pause, step, rewind, fast forward, at a chosen speed."""

from dataclasses import dataclass

import numpy as np

SPEEDS = (1, 2, 5, 10, 20, 50, 100)
"""Speeds to choose from, in seconds of the rover per second of the viewer."""
FAST = 4.0
"""How much faster fast forward and rewind are than the chosen speed."""


@dataclass
class Playback:
    """Where in a journey the page is, and how it moves on."""

    duration: float = 0.0
    """Length of the journey [s]."""
    time: float = 0.0
    """Where it is now [s]."""
    speed: float = 10.0
    """Chosen speed, of SPEEDS."""
    rate: float = 0.0
    """How it moves: 0 paused, 1 playing, FAST or -FAST fast forward and rewind."""

    def play(self) -> None:
        """Play from where it is, from the start if it is at the end."""
        if self.time >= self.duration:
            self.time = 0.0
        self.rate = 1.0

    def pause(self) -> None:
        """Stop where it is."""
        self.rate = 0.0

    def fast_forward(self) -> None:
        """Play on, faster."""
        self.rate = FAST

    def rewind(self) -> None:
        """Play backwards, faster."""
        self.rate = -FAST

    def jump(self, time: float) -> None:
        """Go to a time [s], within the journey."""
        self.time = float(np.clip(time, 0.0, self.duration))

    def step(self, times: np.ndarray, by: int = 1) -> None:
        """Pause and go to the next of `times` (n,) [s], or to the one before if `by` is -1."""
        self.pause()
        if by > 0:
            index = int(np.searchsorted(times, self.time + 1e-9, side="right"))
        else:
            index = int(np.searchsorted(times, self.time - 1e-9, side="left")) - 1
        self.jump(float(times[np.clip(index, 0, len(times) - 1)]))

    def advance(self, seconds: float) -> bool:
        """Move on by the time that passed for the viewer [s]; return whether anything moved."""
        if self.rate == 0.0:
            return False
        self.jump(self.time + self.rate * self.speed * seconds)
        if self.time == (self.duration if self.rate > 0.0 else 0.0):
            self.pause()
        return True

    def describe(self) -> str:
        """Say how it moves."""
        if self.rate == 0.0:
            return "paused"
        way = {1.0: "playing", FAST: "fast forward", -FAST: "rewinding"}[self.rate]
        return f"{way}, {abs(self.rate) * self.speed:g} times as fast as the rover"

    def restart(self, duration: float) -> None:
        """Take another journey, at the same share of the way; pause where it is shorter."""
        share = self.time / self.duration if self.duration > 0.0 else 0.0
        self.duration = duration
        self.jump(share * duration)
