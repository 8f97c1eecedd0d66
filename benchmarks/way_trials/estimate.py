"""Checks of the cheap test of nodes and of the difficulty of edges against the model."""

import numpy as np

from benchmarks.way_trials.grounds import Case
from rover_physics.rover.turning import wheelbase
from rover_planner.planning.lattice.difficulty import (
    difficulty_of,
    estimate_difficulty,
    steepest_climb,
)
from rover_planner.planning.lattice.edges import Edges, JudgedEdges
from rover_planner.planning.lattice.ground_estimate import estimate_ground
from rover_planner.planning.lattice.headings import HEADINGS
from rover_planner.planning.lattice.nodes import Nodes, nodes_within
from rover_planner.planning.lattice.primitives import make_primitives

SHARES = (0.25, 0.1, 0.05)
"""Distances of neighbouring nodes [wheelbases], one lattice after the other."""
_BATCH = 20_000
BATCH = 50
"""Edges judged in one call."""


def check_estimate(case: Case, count: int) -> dict[str, float]:
    """Return how many nodes the cheap test refuses, and how many of these the model passes.

    Lattices get finer until `count` nodes are refused; at most so many are asked about.
    """
    checked, wrong, share = 0, 0, np.nan
    for cell in SHARES:
        nodes = _nodes(case, cell * wheelbase(case.rover))
        groundless = estimate_ground(case.rover, case.terrain, nodes)[0]
        if np.isnan(share):
            share = float(groundless.mean())
        refused = np.flatnonzero(groundless)
        if cell != SHARES[0]:
            refused = np.random.default_rng(0).permutation(refused)
        refused = refused[: count - checked]
        for first in range(0, len(refused), _BATCH):
            codes = case.judge.stand(nodes.poses(refused[first : first + _BATCH]))
            wrong += sum(code == "" for code in codes)
        checked += len(refused)
        if checked >= count:
            break
    return {"checked": checked, "wrong": wrong, "share": share}


def rank_difficulty(case: Case, count: int) -> dict[str, float]:
    """Return how well the difficulty tells refused edges from others, on random edges.

    The rank is the share of pairs of a refused edge and one that passes in which the refused one
    has the higher difficulty; equal ones count half. All edges begin and end at nodes on which the
    rover can stand.
    """
    rover, judge = case.rover, case.judge
    nodes = _nodes(case, SHARES[0] * wheelbase(rover))
    edges = Edges(nodes, make_primitives(rover, nodes.cell, case.options.waypoint_spacing))
    chosen = _draw_edges(case, edges, count)
    lists = edges.samples, JudgedEdges(edges).difficulty
    climb = steepest_climb(rover, rover.friction)
    estimate = estimate_difficulty(rover, case.terrain, nodes, climb, lists)
    columns, passed, refused = nodes.shape[1], [], []
    for first in range(0, len(chosen), BATCH):
        some = chosen[first : first + BATCH].tolist()
        poses = [edges.poses(edge) for edge in some]
        gears = [edges.primitive(edge).gear for edge in some]
        for edge, found in zip(some, judge.judge(poses, gears), strict=True):
            value = difficulty_of(estimate, columns, *divmod(edge, edges.width))
            (refused if found.code else passed).append(value)
    higher = np.array(refused)[:, None] - np.array(passed)
    rank = float(np.mean(np.sign(higher) + 1.0) / 2.0) if higher.size else np.nan
    return {"ranked": len(chosen), "refused": len(refused), "rank": rank}


def _draw_edges(case: Case, edges: Edges, count: int) -> np.ndarray:
    """Return random edges (count,) between nodes on which the rover can stand."""
    nodes, rng, found = edges.nodes, np.random.default_rng(0), np.empty(0, np.int64)
    table, columns = edges.table, edges.nodes.shape[1]
    while len(found) < count:
        drawn = rng.integers(0, nodes.count * edges.width, 4 * count)
        node, k = np.divmod(drawn, edges.width)
        row, column = np.divmod(node // HEADINGS, columns)
        step, heading = table.step[node % HEADINGS, k], table.end_heading[node % HEADINGS, k]
        column, row = column + step[:, 0], row + step[:, 1]
        stays = (heading >= 0) & (column >= 0) & (column < columns)
        stays &= (row >= 0) & (row < nodes.shape[0])
        drawn, node = drawn[stays], node[stays]
        ends = ((row * columns + column) * HEADINGS + heading)[stays]
        stands = [
            np.array([code == "" for code in case.judge.stand(nodes.poses(some))])
            for some in (node, ends)
        ]
        found = np.concatenate([found, drawn[stands[0] & stands[1]]])
    return found[:count]


def _nodes(case: Case, cell: float) -> Nodes:
    """Return the nodes of a whole map."""
    xmin, xmax, ymin, ymax = case.terrain.bounds
    nodes = nodes_within(cell, (xmin, ymin), (xmax, ymax))
    assert nodes.count % HEADINGS == 0
    return nodes
