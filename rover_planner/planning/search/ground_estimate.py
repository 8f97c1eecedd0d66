# SPDX-License-Identifier: Apache-2.0
"""Nodes that no wheel can have ground at, found from the map without the model."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.search.nodes import HEADINGS, YAWS, Nodes

_BETWEEN_CELLS = 1.5
"""Distance [cells] that a place on known ground may seem to be from known cells."""


def find_groundless(rover: Rover, terrain: Terrain, nodes: Nodes) -> NDArray[np.bool_]:
    """Return (nodes,) whether a wheel is over unknown ground however the rover tilts.

    The model refuses these, and some more.

    Args:
        rover: The rover.
        terrain: The ground.
        nodes: The nodes.
    """
    groundless = np.zeros((nodes.count // HEADINGS, HEADINGS), bool)
    unknown = np.isnan(terrain.elevation)
    if not unknown.any():
        return groundless.ravel()
    away, last = ndimage.distance_transform_edt(unknown), np.array(unknown.shape[::-1]) - 1

    def from_known(places: Floats) -> Floats:
        """Return bounds (n,) from below on the distances of places to known cells, in cells."""
        column, row = np.clip(np.rint(places), 0, last).astype(int).T
        return np.asarray(away[row, column])

    at = nodes.poses(np.arange(0, nodes.count, HEADINGS))[:, :2]
    at = (at - terrain.origin) / terrain.resolution
    shift = largest_wheel_shift(rover) / terrain.resolution + _BETWEEN_CELLS
    reach = swing_radius(rover) / terrain.resolution + _BETWEEN_CELLS
    far = np.flatnonzero(from_known(at) > shift - reach)
    for heading, wheels in enumerate(wheel_places(rover) / terrain.resolution):
        for wheel in wheels:
            groundless[far, heading] |= from_known(at[far] + wheel) > shift
    return groundless.ravel()


def wheel_places(rover: Rover) -> NDArray[np.float64]:
    """Return (HEADINGS, 6, 2) x, y [m] of the wheel centres at a node at the origin, level."""
    own = np.array([place[:2] for place in rover.suspension.wheels.values()])
    places = np.concatenate([own, own * (1.0, -1.0)])
    c, s = np.cos(YAWS)[:, None], np.sin(YAWS)[:, None]
    x, y = c * places[:, 0] - s * places[:, 1], s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y], axis=-1)


def largest_wheel_shift(rover: Rover) -> float:
    """Return how far a wheel centre is at most from its place on level ground [m].

    Each link turns by no more than the limits of body, rocker and bogie together.
    """
    suspension = rover.suspension
    rocking, turning = (
        max(map(abs, limits)) for limits in (suspension.rocker_limits, suspension.bogie_limits)
    )
    angles = np.minimum(np.cumsum([rover.limits.tilt, rocking, turning]), math.pi)
    farthest = 0.0
    for name, wheel in suspension.wheels.items():
        joints = [(0.0, 0.0, 0.0), suspension.rocker_pivot, wheel]
        if name in suspension.bogie_wheels:
            joints.insert(2, suspension.bogie_pivot)
        links = (math.dist(*ends) for ends in pairwise(joints))
        chords = (2.0 * k * math.sin(0.5 * a) for k, a in zip(links, angles, strict=False))
        farthest = max(farthest, sum(chords))
    return farthest
