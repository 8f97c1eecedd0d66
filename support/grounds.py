# SPDX-License-Identifier: Apache-2.0
"""Grounds for tests: heights as functions of x and y [m], and terrains made of them."""

from dataclasses import replace

import numpy as np

from rover_physics import Terrain


def make_terrain(height, resolution=0.05, half=4.0) -> Terrain:
    """Return a terrain of float32 heights height(x, y) on a square around the origin."""
    axis = np.arange(round(2 * half / resolution) + 1) * resolution - half
    x, y = np.meshgrid(axis, axis)
    elevation = np.broadcast_to(height(x, y), x.shape).astype(np.float32)
    return Terrain(elevation, resolution, (-half, -half))


def raised(terrain: Terrain, cells, by) -> Terrain:
    """Return a terrain with some cells higher by some metres, or unknown if that is NaN."""
    elevation = terrain.elevation.copy()
    elevation[cells] += by
    return replace(terrain, elevation=elevation)


def waves(x, y):
    """Return gentle waves, passable everywhere."""
    return 0.04 * np.sin(1.3 * x) + 0.03 * np.sin(1.7 * y + 0.4)


def wall_at(place):
    """Return waves with a wall of 1 m along y, at x = place."""
    return lambda x, y: waves(x, y) + np.where(x > place, 1.0, 0.0)


def gap(x, y):
    """Return waves with a band of unknown ground along y."""
    return np.where((x > 0.5) & (x < 1.0), np.nan, waves(x, y))


def wall_with_gap(x, y, height=0.5):
    """Return waves with a wall along y at x = 0, of a height [m], which ends at y = 1 m."""
    return waves(x, y) + height * ((np.abs(x) < 0.2) & (y < 1.0))


def pen(x, y):
    """Return waves with a wall of 1 m around a square of 3 m."""
    edge = np.maximum(np.abs(x), np.abs(y))
    return waves(x, y) + np.where(np.abs(edge - 1.5) < 0.1, 1.0, 0.0)


def rock_left(x, y):
    """Return level ground with a rock below the left wheels of a rover on the x axis."""
    return 0.3 * np.exp(-((x - 0.2) ** 2 + (y - 0.2) ** 2) / 0.02)
