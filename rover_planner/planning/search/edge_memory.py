# SPDX-License-Identifier: Apache-2.0
"""Remembers judged edges and the last path, from one search to the next."""

from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.rover.extent import find_reach
from rover_physics.terrain.ground import BLOCK
from rover_planner.maps.changes import find_changes, have_same_layers
from rover_planner.planning.search.cell_counts import CellCounts
from rover_planner.planning.search.edges import Edges
from rover_planner.planning.search.nodes import HEADINGS, Nodes
from rover_planner.planning.search.primitives import Piece, make_primitives
from rover_planner.planning.search.query import SearchQuery
from rover_planner.planning.search.site import Site

PosesByModel = tuple[KnownPoses, KnownPoses]
"""What is known of poses of whole paths, and of the pieces that a search asks about in numbers,
with other options if the chance of failure counts."""


class EdgeMemory:
    """The judged edges of the last search, its path, and the poses that the model was asked about.

    They are forgotten as a whole if the rover, the arm, an option or the grid of the map change,
    edges also if the window does. If heights or other layers of the map change, those that may
    touch them are.
    """

    def __init__(self) -> None:
        self._edges: tuple[Site, Edges] | None = None
        self._path: tuple[SearchQuery, list[Piece]] | None = None
        self._poses: tuple[Site, PosesByModel] | None = None

    def keep_path(self, query: SearchQuery, pieces: list[Piece]) -> None:
        """Keep the pieces of the path that answers a query."""
        self._path = query, pieces

    def recall_path(self, query: SearchQuery) -> list[Piece]:
        """Return the pieces of the last path if it was between the same ends for the same rover.

        Their cost is NaN where the map or the options may have changed it.
        """
        if self._path is None:
            return []
        asked, pieces = self._path
        is_same = (
            asked.site.rover == query.site.rover
            and np.array_equal(asked.start, query.start)
            and np.array_equal(asked.goal, query.goal)
        )
        if not is_same:
            return []
        if not _is_alike(asked.site, query.site):
            return [replace(one, cost=np.nan) for one in pieces]
        poses, firsts = np.concatenate([one.poses for one in pieces]), [0]
        firsts += np.cumsum([len(one.poses) for one in pieces[:-1]]).tolist()
        changed = _count_changes(asked.site, query.site)
        near = changed.are_near(poses[:, :2], _reach_of(query.site))
        return [
            replace(one, cost=np.nan) if is_near else one
            for one, is_near in zip(pieces, np.logical_or.reduceat(near, firsts), strict=True)
        ]

    def recall_poses(self, site: Site) -> PosesByModel:
        """Return what is known of poses of whole paths, and of pieces; what is added is kept."""
        if self._poses is None or not _is_alike(self._poses[0], site):
            of_pieces, is_same = KnownPoses(), site.options.asked_chance is None
            known = KnownPoses(others=of_pieces if is_same else None), of_pieces
        else:
            asked, known = self._poses
            changed, reach = _count_changes(asked, site), _reach_of(site)
            for one in known:
                one.forget(partial(changed.are_near, reach=reach))
        self._poses = site, known
        return known

    def recall(self, site: Site, nodes: Nodes) -> Edges:
        """Return the edges between nodes with what is known of them; what is added is kept."""
        last = self._edges
        if last is None or last[1].nodes != nodes or not _is_alike(last[0], site):
            spacing = site.options.waypoint_spacing
            edges = Edges(nodes, make_primitives(site.rover, nodes.cell, spacing))
        else:
            asked, edges = last
            edges.forget(_find_touching(site, edges, _count_changes(asked, site)))
        self._edges = site, edges
        return edges


def _is_alike(asked: Site, site: Site) -> bool:
    """Return whether what was judged at one site holds at another, apart from the heights."""
    old, new = asked.terrain, site.terrain
    return (
        asked.rover == site.rover
        and asked.options == site.options
        and asked.unobserved_check.rule == site.unobserved_check.rule
        and asked.marked == site.marked
        and old.resolution == new.resolution
        and old.origin == new.origin
        and old.elevation.shape == new.elevation.shape
        and have_same_layers(old, new)
    )


@lru_cache(maxsize=1)
def _count_changes(asked: Site, site: Site) -> CellCounts:
    """Return the cells in which the maps of two sites that are alike differ, as counts."""
    before, now = asked.unobserved_check.kinds, site.unobserved_check.kinds
    if asked.terrain is site.terrain and before is now:
        return CellCounts(site.terrain, np.zeros(site.terrain.elevation.shape, bool))
    changed = find_changes(asked.terrain, site.terrain)[1:-1, 1:-1]
    if before is not None and now is not None:
        changed |= before != now
    return CellCounts(site.terrain, changed)


def _reach_of(site: Site) -> float:
    """Return how far from the body origin ground may count for a pose [m].

    The kernels look at the blocks of cells that wheels and body touch, however these are turned,
    and at the cells around them.
    """
    return find_reach(site.rover) + (BLOCK + 1) * site.terrain.resolution


def _find_touching(site: Site, edges: Edges, changed: CellCounts) -> NDArray[np.int64]:
    """Return the places (k,) of nodes from which an edge may lead over changed cells."""
    longest = max(one.length for own in edges.primitives for one in own)
    places = edges.nodes.poses(np.arange(0, edges.nodes.count, HEADINGS))[:, :2]
    return np.flatnonzero(changed.are_near(places, longest + _reach_of(site)))
