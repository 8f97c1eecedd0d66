"""Paths, grounds and sessions for tests of the viewer."""

import numpy as np

from rover_physics.rover.rover_file import load_rover
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves

LSR1 = load_rover("lsr1")


def straight(length: float = 2.0, spacing: float = 0.02) -> np.ndarray:
    """Return poses (n, 3) along x from x = -1 m, with a length and a spacing [m]."""
    x = np.arange(-1.0, length - 1.0 + 1e-9, spacing)
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def ramp(x, y):
    """Return waves with a slope of 1 in 4 along x: passable with mu 0.8, only partly with 0.4."""
    return waves(x, y) + 0.25 * x


def session_on(height, start=(-2.0, 0.0, 0.0), goal=(1.0, 0.0, 0.0)) -> ViewSession:
    """Return a session of the LSR-1 on a ground with heights height(x, y) [m]."""
    return ViewSession(LSR1, make_terrain(height), start, goal)
