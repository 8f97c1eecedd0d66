# SPDX-License-Identifier: Apache-2.0
"""Traversability class of each cell of a map and each heading, judged anew where it changed."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.rover.extent import find_reach
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.pose_classes import (
    IMPASSABLE,
    UNKNOWN,
    RoverOnMap,
    classify_poses,
)
from rover_planner.maps.cells import CellGrid, grid_of
from rover_planner.maps.layers import Shift, find_changes, find_overlap, have_same_layers

TILE = 32
"""Cells along the side of a tile; tiles are judged one after another."""
BATCH = 4096
"""Poses for which tiles are judged together; fewer would not use all threads."""
MARGIN = 2
"""Cells by which a rover's reach is widened: a height counts for the ground up to one cell away.
The other one is for safety."""
SHIFT_TOLERANCE = 1e-3
"""Share of a cell by which the grids of two maps may differ and still count as the same."""


@dataclass(frozen=True, eq=False)
class HazardView:
    """The classes at one time."""

    classes: NDArray[np.int8]
    """(headings, ny, nx) class of each heading and cell; UNKNOWN where it is not judged yet."""
    grid: CellGrid
    """The cells."""

    def worst(self) -> NDArray[np.int8]:
        """Return (ny, nx) the worst class; IMPASSABLE is worse than UNKNOWN, all else better."""
        worst = self.classes.max(axis=0)
        unknown = (self.classes == UNKNOWN).any(axis=0)
        return np.where(unknown & (worst != IMPASSABLE), UNKNOWN, worst).astype(np.int8)

    def best(self) -> NDArray[np.int8]:
        """Return (ny, nx) the best known class; UNKNOWN if one heading is and none is passable."""
        known = np.where(self.classes == UNKNOWN, IMPASSABLE, self.classes).min(axis=0)
        unknown = (self.classes == UNKNOWN).any(axis=0)
        return np.where(unknown & (known == IMPASSABLE), UNKNOWN, known).astype(np.int8)


class HazardMap:
    """Keeps the classes of a map; all methods belong to one thread."""

    def __init__(self, headings: int):
        """Keep classes of so many headings: the first along x, then equally spaced to the left."""
        self.headings = headings
        """Number of headings."""
        self._yaw = np.arange(headings) * (2.0 * math.pi / headings)
        self._on_map: RoverOnMap | None = None
        self._classes = np.empty((headings, 0, 0), np.int8)
        self._stale: NDArray[np.bool_] = np.empty((0, 0), bool)

    @property
    def stale_count(self) -> int:
        """Number of poses that are not judged on the present map."""
        return self.headings * int(np.count_nonzero(self._stale))

    def take(self, on_map: RoverOnMap) -> None:
        """Take a rover on a map; what the change of the map cannot have changed stays."""
        before, shape = self._on_map, on_map.terrain.elevation.shape
        shift = None if before is None else _find_shift(before, on_map)
        classes, stale = np.full((self.headings, *shape), UNKNOWN, np.int8), np.ones(shape, bool)
        if before is not None and shift is not None:
            if before.terrain is on_map.terrain:
                return
            changed = find_changes(before.terrain, on_map.terrain, shift)
            old, new = find_overlap(before.terrain, on_map.terrain, shift)
            classes[:, *new] = self._classes[:, *old]
            stale[new] = self._stale[old]
            reach = math.ceil(find_reach(on_map.rover) / on_map.terrain.resolution) + MARGIN
            near = ndimage.maximum_filter(changed, 2 * reach + 1, mode="constant")
            stale |= near[1:-1, 1:-1]
        self._on_map, self._classes, self._stale = on_map, classes, stale

    def work(self, seconds: float, near: tuple[float, float] | None = None) -> bool:
        """Judge stale poses for about some time; return whether none is left.

        Args:
            seconds: Time [s]; the tiles in work are finished.
            near: x, y [m] of the place whose tiles come first; None begins at cell [0, 0].

        Raises:
            ModelError, SoilError: As `classify_poses`.
        """
        if self._on_map is None:
            return True
        end = time.monotonic() + seconds
        terrain = self._on_map.terrain
        for row, column in self._batches(terrain, near):
            poses = np.empty((self.headings, len(row), 3))
            poses[..., 0], poses[..., 1] = grid_of(terrain).places(column, row)
            poses[..., 2] = self._yaw[:, None]
            found = classify_poses(self._on_map, poses.reshape(-1, 3))
            self._classes[:, row, column] = found.reshape(self.headings, -1)
            self._stale[row, column] = False
            if time.monotonic() > end:
                break
        return not self._stale.any()

    def view(self) -> HazardView | None:
        """Return the classes of now; None before the first map."""
        if self._on_map is None:
            return None
        classes = np.where(self._stale, np.int8(UNKNOWN), self._classes)
        return HazardView(classes, grid_of(self._on_map.terrain))

    def _batches(
        self, terrain: Terrain, near: tuple[float, float] | None
    ) -> Iterator[NDArray[np.intp]]:
        """Yield row and column (2, n) of cells with stale poses, BATCH poses or more at a time.

        They come tile by tile, the nearest first.
        """
        rows, columns = (np.arange(0, count, TILE) for count in self._stale.shape)
        in_rows = np.logical_or.reduceat(self._stale, rows, axis=0)
        tiles = np.argwhere(np.logical_or.reduceat(in_rows, columns, axis=1))
        if near is not None:
            place = (np.array(near) - terrain.origin) / (TILE * terrain.resolution) - 0.5
            tiles = tiles[np.argsort(np.hypot(*(tiles[:, ::-1] - place).T), kind="stable")]
        batch = np.empty((2, 0), np.intp)
        for i, j in TILE * tiles:
            stale = np.nonzero(self._stale[i : i + TILE, j : j + TILE])
            batch = np.concatenate([batch, np.add(stale, [[i], [j]])], axis=1)
            if self.headings * batch.shape[1] >= BATCH:
                yield batch
                batch = batch[:, :0]
        if batch.size:
            yield batch


def _find_shift(before: RoverOnMap, now: RoverOnMap) -> Shift | None:
    """Return how far the grid has moved; None if nothing of the old map can be used."""
    old, new = before.terrain, now.terrain
    alike = (
        before.rover == now.rover
        and before.options == now.options
        and before.sigmas == now.sigmas
        and old.resolution == new.resolution
        and have_same_layers(old, new)
    )
    if not alike:
        return None
    moved = (np.asarray(new.origin) - np.asarray(old.origin)) / new.resolution
    cells = np.rint(moved)
    # A pose of a grid that lies between the cells of the other stands on other heights.
    if old.origin != new.origin and np.abs(moved - cells).max() > SHIFT_TOLERANCE:
        return None
    return int(cells[1]), int(cells[0])
