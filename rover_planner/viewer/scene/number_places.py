# SPDX-License-Identifier: Apache-2.0
"""Places for the numbers of paths that do not overlap."""

from collections.abc import Sequence

import numpy as np

from rover_physics.numerics.arrays import Floats

SHARES = np.linspace(0.2, 0.8, 13)
"""Shares of a path at which its number may stand."""
MAX_TRIED = 3
"""Rounds in which the places are improved."""


def place_numbers(paths: Sequence[Floats], taken: Floats) -> Floats:
    """Return a place (k, 2) [m] for the number of each path, far from each other.

    Each number stands on its path, where the nearest of the other numbers and of the taken places
    is furthest.

    Args:
        paths: Points (n, 2) of each path [m].
        taken: Other places (j, 2) that are taken [m].
    """
    choices = [_points_at(path, SHARES) for path in paths]
    places = np.array([points[len(points) // 2] for points in choices]).reshape(-1, 2)
    for _ in range(MAX_TRIED):
        for k, points in enumerate(choices):
            others = np.concatenate([taken.reshape(-1, 2), np.delete(places, k, axis=0)])
            if len(others):
                away = np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1)
                places[k] = points[int(np.argmax(away))]
    return places


def _points_at(path: Floats, shares: Floats) -> Floats:
    """Return the points (k, 2) of a path (n, 2) at shares of its length."""
    steps = np.hypot(*np.diff(path, axis=0).T) if len(path) > 1 else np.zeros(0)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = shares * along[-1]
    return np.column_stack([np.interp(at, along, path[:, axis]) for axis in (0, 1)])
