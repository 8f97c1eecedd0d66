# SPDX-License-Identifier: Apache-2.0
"""A terrain sensor on the rover's mast, with range, field of view, occlusion and noise."""

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain, cut_around
from rover_planner.angles import wrap
from rover_planner.parameters.rover_simulator import ALL_AROUND, RoverSimulatorParameters

RAYS = 1440
"""Directions of the occlusion test: every quarter degree."""


def look(
    asked: RoverSimulatorParameters,
    terrain: Terrain,
    position: Floats,
    yaw: float,
    rng: np.random.Generator,
) -> Terrain:
    """Return the terrain around the rover with noise; cells out of sight are unknown.

    Args:
        asked: The parameters `sensor_...` name the sensor's properties.
        terrain: The true ground.
        position: (3,) body origin [m].
        yaw: Heading [rad].
        rng: Random generator of the noise.

    Raises:
        TerrainError: No cell is in sight.
    """
    noise = asked.sensor_noise
    part = cut_around(terrain, position[None, :2], asked.sensor_range)
    heights = part.elevation.copy()
    y, x = np.indices(heights.shape)
    dx = part.origin[0] + terrain.resolution * x - position[0]
    dy = part.origin[1] + terrain.resolution * y - position[1]
    away = np.hypot(dx, dy)
    bearing = np.arctan2(dy, dx)
    seen = (away <= asked.sensor_range) & (away >= asked.sensor_least_range)
    if asked.sensor_field_of_view < ALL_AROUND:
        aside = np.abs(wrap(bearing - yaw))
        seen &= aside <= 0.5 * asked.sensor_field_of_view
    if asked.sensor_occlusion:
        seen &= _find_visible(asked, terrain, position, heights, away, bearing)
    heights[~seen] = np.nan
    std = None
    if noise > 0.0:
        heights += rng.normal(0.0, noise, heights.shape)
        std = np.where(seen, noise, np.nan)
    return Terrain(heights, terrain.resolution, part.origin, part.friction, elevation_std=std)


def _find_visible(
    asked: RoverSimulatorParameters,
    terrain: Terrain,
    position: Floats,
    heights: Floats,
    away: Floats,
    bearing: Floats,
) -> NDArray[np.bool_]:
    """Return a mask of the cells that no nearer cell on the same ray hides."""
    eye = position[2] + asked.sensor_height
    ranges = np.arange(
        terrain.resolution,
        asked.sensor_range + terrain.resolution,
        terrain.resolution,
    )
    angles = (np.arange(RAYS) + 0.5) * (2.0 * np.pi / RAYS) - np.pi
    px = position[0] + ranges * np.cos(angles)[:, None]
    py = position[1] + ranges * np.sin(angles)[:, None]
    slopes = (terrain.elevation_at(px, py) - eye) / ranges
    highest = np.maximum.accumulate(np.where(np.isnan(slopes), -np.inf, slopes), axis=1)
    before = np.hstack([np.full((RAYS, 1), -np.inf), highest[:, :-1]])
    ray = np.clip(((bearing + np.pi) / (2.0 * np.pi) * RAYS).astype(int), 0, RAYS - 1)
    step = np.clip((away / terrain.resolution).astype(int) - 1, 0, len(ranges) - 1)
    near = away < 1.5 * terrain.resolution
    own = (heights - eye) / np.maximum(away, 1e-9)
    # Occlusion by less than the size of a cell is ignored.
    allowance = 0.5 * terrain.resolution / np.maximum(away, terrain.resolution)
    return np.asarray(near | (own >= before[ray, step] - allowance))
