# SPDX-License-Identifier: Apache-2.0
"""Remembers judged edges from one search to the next while the ground under them is the same."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.rover.turning import swing_radius
from rover_planner.maps.changes import find_changes, have_same_layers
from rover_planner.maps.unobserved_ground import ALLOW
from rover_planner.planning.lattice.edges import Edges, JudgedEdges
from rover_planner.planning.lattice.headings import HEADINGS
from rover_planner.planning.lattice.nodes import Nodes
from rover_planner.planning.lattice.primitives import make_primitives
from rover_planner.planning.ways.question import WayQuestion


class EdgeMemory:
    """The judged edges of the last search.

    They are forgotten as a whole if the rover, the arm, an option, the window or the grid of the
    map change. If heights or other layers of the map change, those within reach are forgotten.
    """

    def __init__(self) -> None:
        self._asked: WayQuestion | None = None
        self._known: JudgedEdges | None = None

    def recall(self, question: WayQuestion, nodes: Nodes) -> JudgedEdges:
        """Return what is known of the edges between nodes, and remember what is added to it."""
        known, asked = self._known, self._asked
        if known is None or asked is None or not _is_alike(asked, question, known, nodes):
            spacing = question.options.waypoint_spacing
            edges = Edges(nodes, make_primitives(question.rover, nodes.cell, spacing))
            known = JudgedEdges(edges)
        elif asked.terrain is not question.terrain or _sees_otherwise(asked, question):
            changed = find_changes(asked.terrain, question.terrain)[1:-1, 1:-1]
            changed |= _find_newly_seen(asked, question)
            known.forget(_places_within_reach(question, known.edges, changed))
        self._asked, self._known = question, known
        return known


def _is_alike(asked: WayQuestion, question: WayQuestion, known: JudgedEdges, nodes: Nodes) -> bool:
    """Return whether edges judged for one question hold for another, apart from the heights."""
    old, new = asked.terrain, question.terrain
    return (
        known.edges.nodes == nodes
        and asked.rover == question.rover
        and asked.options == question.options
        and _rule_of(asked) == _rule_of(question)
        and old.resolution == new.resolution
        and old.origin == new.origin
        and old.elevation.shape == new.elevation.shape
        and have_same_layers(old, new)
    )


def _rule_of(question: WayQuestion) -> str:
    """Return the rule of UNOBSERVED_GROUND of a question."""
    return ALLOW if question.blind is None else question.blind.rule


def _sees_otherwise(asked: WayQuestion, question: WayQuestion) -> bool:
    """Return whether what was seen may differ between two questions of one rule, and counts."""
    if _rule_of(question) == ALLOW or asked.blind is None or question.blind is None:
        return False
    return asked.blind.seen.kinds is not question.blind.seen.kinds


def _find_newly_seen(asked: WayQuestion, question: WayQuestion) -> NDArray[np.bool_]:
    """Return (ny, nx) True for the cells of which something else is known whether it was seen."""
    old, new = asked.blind, question.blind
    if old is None or new is None or not _sees_otherwise(asked, question):
        return np.zeros(question.terrain.elevation.shape, bool)
    return np.asarray(old.seen.kinds != new.seen.kinds)


def _places_within_reach(
    question: WayQuestion, edges: Edges, changed: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the places (k,) of nodes from which an edge may lead over changed cells."""
    if not changed.any():
        return np.empty(0, np.int64)
    rover, terrain, nodes = question.rover, question.terrain, edges.nodes
    longest = max(one.length for own in edges.primitives for one in own)
    reach = longest + swing_radius(rover) + 2.0 * rover.wheel.radius + 2.0 * terrain.resolution
    away = terrain.resolution * ndimage.distance_transform_edt(~changed)
    x, y, _ = nodes.poses(np.arange(0, nodes.count, HEADINGS)).T
    ny, nx = changed.shape
    column = np.clip(np.rint((x - terrain.origin[0]) / terrain.resolution), 0, nx - 1)
    row = np.clip(np.rint((y - terrain.origin[1]) / terrain.resolution), 0, ny - 1)
    return np.flatnonzero(away[row.astype(int), column.astype(int)] <= reach + nodes.cell)
