# SPDX-License-Identifier: Apache-2.0
"""Grounds for tests: heights as functions of x and y [m], terrains made of them, rough ones."""

from dataclasses import replace

import numpy as np

from rover_physics import Rover, Terrain
from support.paths import poses_at

RESOLUTION = 0.04
"""Cell size of rough grounds and planes [m]."""


def make_terrain(height, resolution=0.05, half=4.0) -> Terrain:
    """Return a terrain of float32 heights height(x, y) on a square around the origin."""
    x, y = _grid(half, resolution)
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


def plane(slope_x: float, slope_y: float, height: float = 0.0, half: float = 1.2) -> Terrain:
    """Return the plane z = slope_x x + slope_y y + height around the origin."""
    x, y = _grid(half)
    return Terrain(slope_x * x + slope_y * y + height, RESOLUTION, (x[0, 0], y[0, 0]))


def smooth(seed: int, half: float = 1.6) -> Terrain:
    """Return the sum of a few long waves, up to 0.1 m high."""
    rng = np.random.default_rng(seed)
    x, y = _grid(half)
    z = np.zeros_like(x)
    for _ in range(4):
        kx, ky, phase = rng.uniform(-2.5, 2.5), rng.uniform(-2.5, 2.5), rng.uniform(0.0, 6.3)
        z += rng.uniform(0.0, 0.025) * np.sin(kx * x + ky * y + phase)
    return Terrain(z, RESOLUTION, (x[0, 0], y[0, 0]))


def fractal(seed: int, half: float = 3.0, roughness: float = 0.06) -> Terrain:
    """Return relief with a power-law spectrum and an RMS height of `roughness` [m]."""
    rng = np.random.default_rng(seed)
    x, y = _grid(half)
    rows, columns = x.shape
    wave = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None, :])
    wave[0, 0] = np.inf
    z = np.fft.irfft2(np.fft.rfft2(rng.standard_normal(x.shape)) * wave**-1.7, s=x.shape)
    return Terrain(z * (roughness / z.std()), RESOLUTION, (x[0, 0], y[0, 0]))


def rocky(seed: int, half: float = 3.0, count: int = 120) -> Terrain:
    """Return gentle relief with spherical caps of 5 to 20 cm radius."""
    rng = np.random.default_rng(seed)
    x, y = _grid(half)
    z = fractal(seed + 1000, half, 0.03).elevation.copy()
    for _ in range(count):
        cx, cy, radius = *rng.uniform(-half, half, 2), rng.uniform(0.05, 0.20)
        cap = np.sqrt(np.clip(radius**2 - (x - cx) ** 2 - (y - cy) ** 2, 0.0, None))
        z += 0.6 * cap
    return Terrain(z, RESOLUTION, (x[0, 0], y[0, 0]))


def bouldered(seed: int, half: float = 3.0, count: int = 150, highest: float = 0.1) -> Terrain:
    """Return gentle relief with half-ellipsoids, 2 cm to `highest` [m] high.

    Their radius is at most twice their height, and their rims are vertical.
    """
    rng = np.random.default_rng(seed)
    x, y = _grid(half)
    relief = fractal(seed + 500, half, 0.03).elevation
    z = relief.copy()
    for _ in range(count):
        (cx, cy), height = rng.uniform(-half, half, 2), rng.uniform(0.02, highest)
        width = height * rng.uniform(1.0, 2.0)
        near = np.ix_(np.abs(y[:, 0] - cy) < width, np.abs(x[0] - cx) < width)
        away = (x[near] - cx) ** 2 + (y[near] - cy) ** 2
        inside = np.clip(1.0 - away / width**2, 0.0, None)
        z[near] = np.maximum(z[near], relief[near] + height * np.sqrt(inside))
    return Terrain(z, RESOLUTION, (x[0, 0], y[0, 0]))


def bowl(depth: float, floor: float, slope: float, half: float = 6.0) -> Terrain:
    """Return a round crater: a level floor of radius `floor` [m], then walls of `slope` [rad]."""
    away = np.hypot(*_grid(half, 0.05))
    return Terrain(np.clip((away - floor) * np.tan(slope), 0.0, depth), 0.05, (-half, -half))


def with_std(terrain: Terrain, std: float) -> Terrain:
    """Return the terrain with the same standard deviation [m] everywhere."""
    return replace(terrain, elevation_std=np.full(terrain.elevation.shape, std))


def random_poses(seed: int, count: int, half: float) -> np.ndarray:
    """Return random poses (count, 3) within `half` [m] of the origin, with random headings."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-half, half, (count, 2))
    return poses_at(*places.T, rng.uniform(-np.pi, np.pi, count))


def enlarged(ground: Terrain, size: float) -> Terrain:
    """Return a ground that is `size` times as large in all directions."""
    x, y = ground.origin
    std = ground.elevation_std
    return replace(
        ground,
        elevation=ground.elevation * size,
        resolution=ground.resolution * size,
        origin=(x * size, y * size),
        elevation_std=None if std is None else std * size,
    )


def scaled_for(rover: Rover, ground: Terrain, poses: np.ndarray) -> tuple[Terrain, np.ndarray]:
    """Return ground and poses as large for a rover as they are for one with wheels of 0.1 m."""
    size = rover.wheel.radius / 0.1
    return enlarged(ground, size), poses * [size, size, 1.0]


def _grid(half: float, resolution: float = RESOLUTION) -> tuple[np.ndarray, np.ndarray]:
    count = round(half / resolution)
    axis = np.arange(-count, count + 1) * resolution
    x, y = np.meshgrid(axis, axis)
    return x, y
