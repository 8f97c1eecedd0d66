# SPDX-License-Identifier: Apache-2.0
"""Remembers judged edges and the last path, from one search to the next."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.rover.extent import find_reach
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import BLOCK
from rover_planner.maps.layers import find_changes, have_same_layers
from rover_planner.planning.search.edges import Edges, Piece, make_primitives
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.nodes import HEADINGS, Nodes
from rover_planner.planning.search.query import SearchQuery, Site

MARGIN = BLOCK + 1
"""Distance from wheels and body within which ground counts for a pose [cells]: the kernels look at
the blocks of cells that these touch, however they are turned, and at the cells around them."""


class EdgeMemory:
    """The judged edges of the last search, its path, and the poses that the model was asked about.

    They are forgotten as a whole if the rover, the arm, an option or the grid of the map change,
    edges also if the window does. If heights or other layers of the map change, those that may
    touch them are.
    """

    def __init__(self) -> None:
        self._judge: PathJudge | None = None
        """The model at the site of the last search."""
        self._edges: Edges | None = None
        self._query: SearchQuery | None = None
        self._pieces: list[Piece] = []

    def begin(self, site: Site) -> PathJudge:
        """Forget what does not hold at the site of the next search.

        Returns the model there, with what is known of poses; what it finds is kept.
        """
        before, self._judge = self._judge, None  # if forgetting fails, nothing holds
        if before is None or not _is_alike(before.site, site):
            of_pieces, is_same = KnownPoses(), site.options.asked_chance is None
            judge = PathJudge(site, KnownPoses(others=of_pieces if is_same else None), of_pieces)
            self._edges = None
            self._forget_costs(lambda places: np.ones(len(places), bool))
        else:
            judge, changed = replace(before, site=site), _find_changed(before.site, site)
            if changed.any():
                self._forget_near(changed, judge)
        self._judge = judge
        return judge

    def _forget_near(self, changed: NDArray[np.bool_], judge: PathJudge) -> None:
        """Forget what the cells (ny, nx) of the map that have changed may touch."""
        site = judge.site
        reach = find_reach(site.rover) + MARGIN * site.terrain.resolution
        are_near = _look_near(changed, site.terrain, reach)
        for known in (judge.known, judge.known_in_pieces):
            if known is not None:
                known.forget(are_near)
        self._forget_costs(are_near)
        if self._edges is not None:
            longest = max(one.length for own in self._edges.primitives for one in own)
            nodes = self._edges.nodes
            places = nodes.poses(np.arange(0, nodes.count, HEADINGS))[:, :2]
            begins_near = _look_near(changed, site.terrain, longest + reach)
            self._edges.forget(np.flatnonzero(begins_near(places)))

    def _forget_costs(self, are_near: Callable[[Floats], NDArray[np.bool_]]) -> None:
        """Forget the costs of pieces of the path with places (n, 2) of which some are near."""
        self._pieces = [
            replace(one, cost=np.nan) if are_near(one.poses[:, :2]).any() else one
            for one in self._pieces
        ]

    def keep_path(self, query: SearchQuery, pieces: list[Piece]) -> None:
        """Keep the pieces of the path that answers a query."""
        self._query, self._pieces = query, pieces

    def recall_path(self, query: SearchQuery) -> list[Piece]:
        """Return the pieces of the last path if it was between the same ends for the same rover.

        Their cost is NaN where the map or the options may have changed it.
        """
        asked = self._query
        is_same = (
            asked is not None
            and asked.site.rover == query.site.rover
            and np.array_equal(asked.start, query.start)
            and np.array_equal(asked.goal, query.goal)
        )
        return self._pieces if is_same else []

    def recall_edges(self, site: Site, nodes: Nodes) -> Edges:
        """Return the edges between nodes with what is known of them; what is added is kept."""
        if self._edges is None or self._edges.nodes != nodes:
            spacing = site.options.waypoint_spacing
            self._edges = Edges(nodes, make_primitives(site.rover, nodes.cell, spacing))
        return self._edges


def _is_alike(asked: Site, site: Site) -> bool:
    """Return whether what was judged at one site holds at another, apart from the heights."""
    old, new = asked.terrain, site.terrain
    return (
        asked.rover == site.rover
        and asked.options == site.options
        and asked.blind_ground == site.blind_ground
        and asked.marked == site.marked
        and old.resolution == new.resolution
        and old.origin == new.origin
        and old.elevation.shape == new.elevation.shape
        and have_same_layers(old, new)
    )


def _find_changed(asked: Site, site: Site) -> NDArray[np.bool_]:
    """Return the cells (ny, nx) in which the maps of two sites that are alike differ."""
    before, now = asked.checked_ground, site.checked_ground
    if asked.terrain is site.terrain and before is now:
        return np.zeros(site.terrain.elevation.shape, bool)
    changed = find_changes(asked.terrain, site.terrain)[1:-1, 1:-1]
    if before is not None and now is not None:
        changed |= before.kinds != now.kinds
    return changed


def _look_near(
    changed: NDArray[np.bool_], terrain: Terrain, reach: float
) -> Callable[[Floats], NDArray[np.bool_]]:
    """Return what tells of places (n, 2) if a cell within `reach` [m] in x or y has changed."""
    cells = math.ceil(reach / terrain.resolution + 0.5)
    near = ndimage.maximum_filter(changed, 2 * cells + 1, mode="constant")

    def are_near(places: Floats) -> NDArray[np.bool_]:
        at = np.rint((places - terrain.origin) / terrain.resolution).astype(int)
        column, row = np.clip(at, 0, np.array(near.shape[::-1]) - 1).T
        return np.asarray(near[row, column])

    return are_near
