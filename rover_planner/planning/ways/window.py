# SPDX-License-Identifier: Apache-2.0
"""The part of a map that is searched: the nodes of the lattice, and the heights around them."""

import math

import numpy as np

from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.lattice.headings import HEADINGS
from rover_planner.planning.lattice.nodes import Nodes, nodes_within
from rover_planner.planning.ways.question import WayQuestion

MAX_NODES = 1_500_000
"""Largest number of nodes of a window; each takes 70 bytes."""


def choose_window(question: WayQuestion, cell: float) -> tuple[Nodes, bool]:
    """Return the nodes to search, and whether they are fewer than those of the map.

    A window that must be limited is a square around start and goal.
    """
    xmin, xmax, ymin, ymax = question.terrain.bounds
    nodes = nodes_within(cell, (xmin, ymin), (xmax, ymax))
    if nodes.count <= MAX_NODES:
        return nodes, False
    half = 0.5 * cell * (math.isqrt(MAX_NODES // HEADINGS) - 1)
    centre = 0.5 * (np.asarray(question.start)[:2] + np.asarray(question.goal)[:2])
    low = np.maximum(centre - half, (xmin, ymin))
    high = np.minimum(centre + half, (xmax, ymax))
    return nodes_within(cell, (low[0], low[1]), (high[0], high[1])), True


def cut_out(question: WayQuestion, nodes: Nodes) -> Terrain:
    """Return the heights of the map within the rover's reach of the nodes, without other layers.

    The map itself comes back where that is all of it, or no height in the part is known.
    """
    terrain = question.terrain
    reach = swing_radius(question.rover) + 2.0 * question.rover.wheel.radius
    low = nodes.cell * np.array(nodes.first, float) - reach
    high = low + nodes.cell * (np.array(nodes.shape[::-1]) - 1) + 2.0 * reach
    size = np.array(terrain.elevation.shape[::-1])
    first = np.clip(np.floor((low - terrain.origin) / terrain.resolution), 0, size - 2).astype(int)
    last = np.clip(np.ceil((high - terrain.origin) / terrain.resolution), first + 1, size - 1)
    columns, rows = (slice(a, int(b) + 1) for a, b in zip(first, last, strict=True))
    part = terrain.elevation[rows, columns]
    if part.shape == terrain.elevation.shape or np.isnan(part).all():
        return terrain
    x, y = np.asarray(terrain.origin) + terrain.resolution * first
    # Kernels are compiled for arrays without gaps.
    return Terrain(np.ascontiguousarray(part), terrain.resolution, (float(x), float(y)))
