# SPDX-License-Identifier: Apache-2.0
"""Tests of the shortest paths on a lattice against scipy's Dijkstra."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from rover_physics import load_rover
from rover_planner.planning.search.difficulty import SAMPLE_SHARE, Difficulty, sample_primitives
from rover_planner.planning.search.edges import FAILS, PASSES, Edges, make_primitives
from rover_planner.planning.search.graph import Seeds, ShortestPaths, edge_cost
from rover_planner.planning.search.nodes import nodes_within

NODES = nodes_within(0.2, (0.0, 0.0), (1.6, 1.2))
PRIMITIVES = make_primitives(load_rover("lsr1"), 0.2, 0.1)
EDGES = Edges(NODES, PRIMITIVES)


def random_knowledge(seed):
    """Return edges of which half is judged, some refused, and hard ground."""
    rng = np.random.default_rng(seed)
    known = Edges(NODES, PRIMITIVES)
    judged = rng.random(known.state.shape) < 0.5
    known.state[judged] = rng.choice([PASSES, PASSES, FAILS], judged.sum())
    least = np.tile(EDGES.least_cost, (EDGES.nodes.count // 16, 1))
    known.cost[:] = np.where(np.isfinite(least), least, 0.0) * (1.0 + rng.random(least.shape))
    known.standing[rng.random(EDGES.nodes.count) < 0.3] = FAILS
    steps = rng.integers(0, 255, (16, 5, 6), np.uint8)
    level = np.zeros((2, 5, 6), np.float32), np.zeros((16, 6, 2), np.int64), 1.0
    places = sample_primitives(PRIMITIVES, SAMPLE_SHARE * NODES.cell)
    hardness = Difficulty(*level, steps, np.zeros(2), 0.5, NODES.cell, places)
    return known, hardness


def explicit_costs(known, graph):
    """Return the matrix of the costs of all edges that are not refused."""
    best, shape = {}, EDGES.nodes.shape
    for node in range(EDGES.nodes.count):
        place, heading = divmod(node, 16)
        row, column = divmod(place, shape[1])
        for k, primitive in enumerate(PRIMITIVES[heading]):
            x, y = column + primitive.step[0], row + primitive.step[1]
            if not (0 <= x < shape[1] and 0 <= y < shape[0]):
                continue
            end = (y * shape[1] + x) * 16 + primitive.end_heading
            if known.state[node, k] < FAILS and known.standing[end] < FAILS:
                cost = edge_cost(graph, node, k, end)
                best[node, end] = min(cost, best.get((node, end), np.inf))
    ends = np.array(list(best), int).reshape(-1, 2)
    return csr_array((list(best.values()), tuple(ends.T)), shape=2 * (EDGES.nodes.count,))


def test_the_shortest_path_is_that_of_dijkstra_whatever_is_known():
    found = 0
    for seed, caution in enumerate((1.0, 0.0)):
        known, hardness = random_knowledge(seed)
        rng = np.random.default_rng(seed + 100)
        free = np.flatnonzero(known.standing == 0)
        starts = Seeds(rng.choice(free, 3, replace=False), rng.random(3))
        goals = Seeds(rng.choice(free, 3, replace=False), rng.random(3))
        search = ShortestPaths(known, hardness, starts)
        route = search.find(starts, goals, caution)
        costs = dijkstra(explicit_costs(known, search.graph(caution)), indices=starts.nodes)
        totals = starts.costs[:, None] + costs[:, goals.nodes] + goals.costs
        if route is None:
            assert np.isinf(totals.min())
            continue
        found += 1
        assert abs(route.cost - totals.min()) < 1e-5
        ends = EDGES.ends(route.edges)
        firsts = route.edges // EDGES.width
        np.testing.assert_array_equal(ends[:-1], firsts[1:])
        assert firsts[0] == starts.nodes[route.start] and ends[-1] == goals.nodes[route.goal]
    assert found > 0
