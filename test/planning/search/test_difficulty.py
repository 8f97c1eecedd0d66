# SPDX-License-Identifier: Apache-2.0
"""Tests of the estimate how likely the model refuses an edge."""

import numpy as np

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.difficulty import (
    difficulty_of,
    estimate_difficulty,
    steepest_climb,
)
from rover_planner.planning.search.edges import Edges
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.nodes import nodes_within
from rover_planner.planning.search.primitives import Gear, make_primitives
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.grounds import make_terrain

LSR1 = load_rover("lsr1")
CLIMB = steepest_climb(LSR1, LSR1.friction)
NODES = nodes_within(0.2, (-1.6, -1.6), (1.6, 1.6))
EDGES = Edges(NODES, make_primitives(LSR1, NODES.cell, 0.04))


def difficulties(ground):
    """Return the difficulties (n,) of the edges that stay in the window, and the edges."""
    lists = EDGES.samples, np.zeros_like(EDGES.difficulty)
    estimate = estimate_difficulty(LSR1, ground, NODES, CLIMB, lists)
    edges = []
    for node in range(NODES.count):
        row, column = divmod(node // 16, NODES.shape[1])
        for k, primitive in enumerate(EDGES.primitives[node % 16]):
            x, y = column + primitive.step[0], row + primitive.step[1]
            if 0 <= x < NODES.shape[1] and 0 <= y < NODES.shape[0]:
                edges.append(node * EDGES.width + k)
    columns = NODES.shape[1]
    found = [difficulty_of(estimate, columns, *divmod(edge, EDGES.width)) for edge in edges]
    return np.array(found), np.array(edges)


def test_edges_that_the_model_refuses_are_the_more_difficult_ones():
    seed = 3
    ground = make_mars_terrain(seed, rock_cover=0.15, crater_density=0.0, size=6.0)
    estimate, edges = difficulties(ground)
    chosen = np.random.default_rng(seed).choice(len(edges), 500, replace=False)
    judge = PathJudge(
        LSR1, ground, PathQueryOptions(waypoint_spacing=0.04).change(control_margin=0.0)
    )
    asked = edges[chosen]
    verdicts = judge.judge_pieces([EDGES.piece(edge) for edge in asked])
    refused = np.array([verdict.code != "" for verdict in verdicts])
    assert 20 < refused.sum() < 480
    passed, failed = estimate[chosen][~refused], estimate[chosen][refused]
    ranked = np.mean(failed[:, None] > passed) + 0.5 * np.mean(failed[:, None] == passed)
    assert ranked > 0.75  # 0.5 if the estimate knew nothing


def test_steeper_ground_is_more_difficult_and_level_ground_alike_everywhere():
    before = 0.0
    for slope in (0.0, 0.2, 0.3, 0.4):
        found, edges = difficulties(make_terrain(lambda x, y, s=slope: s * x, half=3.5))
        assert np.median(found) > before
        before = np.median(found)
        gears = np.array([EDGES.primitive(edge).gear for edge in edges])
        assert slope == 0.0 or all(found[gears == gear].min() > 0.0 for gear in Gear)
        if slope == 0.0:
            assert np.ptp(found) == 0.0


def test_unknown_ground_is_as_difficult_as_the_ground_beside_it():
    level = make_terrain(lambda x, y: 0.0 * x, half=3.5)
    elevation = np.array(level.elevation)
    elevation[:, : elevation.shape[1] // 2] = np.nan
    found, _ = difficulties(Terrain(elevation, level.resolution, level.origin))
    assert np.ptp(found) == 0.0
