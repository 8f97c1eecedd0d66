# SPDX-License-Identifier: Apache-2.0
"""Ground under the belly that was never seen: its share of a path, and where it is met first."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.cells import CellBox, grid_of
from rover_planner.maps.layers import FOOTPRINT, CellSources

UNOBSERVED_CODE = "blind_ground"
"""Code of the refusal."""
ALLOW, ALLOW_FOOTPRINT, REFUSE = "allow", "allow_footprint", "refuse"
"""Rules, values of the parameter blind_ground: paths whose belly passes over ground that was never
seen are allowed, allowed over the start footprint only, or refused."""
SEEN, ASSUMED, UNSEEN = range(3)
"""Kinds of cells: measured, filled in as part of the start footprint, or nothing."""
MOST = 300
"""Largest number of points along a side of the belly."""
CHUNK = 500_000
"""Points that are looked up at once."""


@dataclass(frozen=True)
class UnobservedShare:
    """Ground under the belly along a path."""

    unobserved_share: float
    """Share of the cells under the belly that were never seen, 0 to 1."""
    footprint_share: float
    """Share of the cells under the belly that were filled in as start footprint."""
    first: int
    """First waypoint whose belly is over unobserved ground, -1 if none."""
    first_beyond_footprint: int
    """The same without the start footprint."""

    def first_refused(self, rule: str) -> int:
        """Return the first waypoint that a value of blind_ground refuses, -1 if none."""
        if rule == ALLOW:
            return -1
        return self.first if rule == REFUSE else self.first_beyond_footprint


@dataclass(frozen=True, eq=False)
class ObservedGround:
    """The seen part of a map."""

    terrain: Terrain
    """The map, of which the cells count."""
    kinds: NDArray[np.uint8]
    """(ny, nx) SEEN, ASSUMED or UNSEEN."""

    def share(self, rover: Rover, poses: NDArray[np.float64]) -> UnobservedShare:
        """Return the share of unobserved ground under the belly of a rover along poses (n, 3).

        The belly is the rectangle of the rover file, seen from above. The shares are those of
        cells on the map; ground off the map counts for the first waypoints.
        """
        if self._is_seen_around(rover, poses):
            return UnobservedShare(0.0, 0.0, -1, -1)
        worst, swept = self._look_below(rover, poses)
        counts = np.bincount(self.kinds[swept], minlength=3)
        if not counts.any():
            return UnobservedShare(1.0, 0.0, 0, 0)
        total, assumed = int(counts.sum()), int(counts[ASSUMED])
        unobserved = (assumed + int(counts[UNSEEN])) / total
        first, beyond = (
            int(np.argmax(worst > best)) if worst.max() > best else -1 for best in (SEEN, ASSUMED)
        )
        return UnobservedShare(unobserved, assumed / total, first, beyond)

    def refused_below(
        self, rover: Rover, poses: NDArray[np.float64], rule: str
    ) -> NDArray[np.bool_]:
        """Return (n,) whether a value of blind_ground refuses the ground under the belly.

        Ground off the map counts as never seen, as in `share`.
        """
        if rule == ALLOW or self._is_seen_around(rover, poses):
            return np.zeros(len(poses), bool)
        best = ASSUMED if rule == ALLOW_FOOTPRINT else SEEN
        return self._look_below(rover, poses)[0] > best

    def _is_seen_around(self, rover: Rover, poses: NDArray[np.float64]) -> bool:
        """Return whether all ground around a path is on the map and was seen."""
        low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
        reach = _corner_distance(rover) + self.terrain.resolution
        box = grid_of(self.terrain).box_around(0.5 * (low + high), 0.5 * (high - low) + reach)
        whole = CellBox(0, 0, *self.kinds.shape)
        return whole.contains(box) and not (self.kinds[box.within(whole)] != SEEN).any()

    def _look_below(
        self, rover: Rover, poses: NDArray[np.float64]
    ) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Return the worst kind (n,) of the ground below the belly at poses (n, 3).

        Ground off the map is UNSEEN. The second is True for the cells (ny, nx) of the map that are
        below the belly at any of them.
        """
        terrain, belly, (ny, nx) = self.terrain, rover.belly, self.kinds.shape
        step = 0.7 * terrain.resolution  # no cell is narrower than that across its diagonal
        along, across = (
            np.linspace(low, high, min(max(2, math.ceil((high - low) / step) + 1), MOST))
            for low, high in (belly.x, belly.y)
        )
        u, v = (axis.ravel() for axis in np.meshgrid(along, across))
        worst, swept = np.full(len(poses), UNSEEN, np.uint8), np.zeros(self.kinds.shape, bool)
        most = _corner_distance(rover) + terrain.resolution
        low, high = np.reshape(terrain.bounds, (2, 2)).T
        near = np.flatnonzero(
            ((poses[:, :2] >= low - most) & (poses[:, :2] <= high + most)).all(1)
        )
        for here in np.array_split(near, 1 + len(near) * len(u) // CHUNK):
            x, y, yaw = poses[here, :, None].transpose(1, 0, 2)
            c, s = np.cos(yaw), np.sin(yaw)
            columns, rows = grid_of(terrain).coordinates(x + c * u - s * v, y + s * u + c * v)
            i, j = np.rint(rows).astype(np.intp), np.rint(columns).astype(np.intp)
            on_map = (i >= 0) & (i < ny) & (j >= 0) & (j < nx)
            kinds = np.where(on_map, self.kinds[i.clip(0, ny - 1), j.clip(0, nx - 1)], UNSEEN)
            worst[here] = kinds.max(axis=1)
            swept[i[on_map], j[on_map]] = True
        return worst, swept


def _corner_distance(rover: Rover) -> float:
    """Return the distance of the belly's farthest corner from the body origin [m]."""
    return max(math.hypot(x, y) for x in rover.belly.x for y in rover.belly.y)


def observed_ground(received: Terrain, sources: CellSources | None) -> ObservedGround:
    """Return what was seen of a map.

    Args:
        received: The map without interpolated gaps.
        sources: Where its cells come from; None: every known cell was seen.
    """
    kinds = np.where(np.isnan(received.elevation), UNSEEN, SEEN).astype(np.uint8)
    if sources is not None:
        kinds[(sources.source == FOOTPRINT) & (kinds == SEEN)] = ASSUMED
    return ObservedGround(received, kinds)
