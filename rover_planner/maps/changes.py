# SPDX-License-Identifier: Apache-2.0
"""The cells in which a map differs from the one before."""

import numpy as np
from numpy.typing import NDArray

from rover_physics.terrain.grid import Terrain
from rover_planner.maps.cells import CellBox

LAYERS = ("elevation", "friction", "soil", "elevation_std", "ground_class")
"""Layers of a map that count."""
Window = tuple[slice, slice]
"""Rows and columns of a map."""
Shift = tuple[int, int]
"""Rows and columns from cell [0, 0] of a map to that of the next one."""


def have_same_layers(old: Terrain, new: Terrain) -> bool:
    """Return whether two maps have the same layers, and the same soils in them."""
    return old.soil_names == new.soil_names and all(
        (getattr(old, name) is None) == (getattr(new, name) is None) for name in LAYERS
    )


def find_overlap(old: Terrain, new: Terrain, shift: Shift) -> tuple[Window, Window]:
    """Return the cells that two maps have in common, as those of the old and of the new map."""
    before = CellBox(0, 0, *old.elevation.shape)
    now = CellBox(*shift, *new.elevation.shape)
    return now.within(before), before.within(now)


def find_changes(old: Terrain, new: Terrain, shift: Shift = (0, 0)) -> NDArray[np.bool_]:
    """Return where a map differs from the one before.

    Args:
        old: The map before.
        new: The map, with the same layers.
        shift: Rows and columns from cell [0, 0] of the old map to that of the new one.

    Returns:
        (ny + 2, nx + 2) True for cells that are new or differ, with one more cell at each side,
        which is True if the map's edge has moved.
    """
    ny, nx = new.elevation.shape
    changed = np.ones((ny + 2, nx + 2), bool)
    if shift == (0, 0) and old.elevation.shape == new.elevation.shape:
        changed[:] = False
    before, now = find_overlap(old, new, shift)
    inside = changed[1:-1, 1:-1]
    inside[now] = False
    for name in LAYERS:
        one, other = getattr(old, name), getattr(new, name)
        if one is not None:
            a, b = one[before], other[now]
            inside[now] |= ~((a == b) | ((a != a) & (b != b)))
    return changed
