# SPDX-License-Identifier: Apache-2.0
"""Tests of what is remembered from one search to the next."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.terrain.ground import pack_ground
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search import edge_memory
from rover_planner.planning.search.edge_memory import EdgeMemory, _look_near
from rover_planner.planning.search.edges import Gear, Piece
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.query import Site
from support.grounds import make_terrain, raised, rocky, waves
from support.predictions import assert_same
from support.rovers import LSR1

OPTIONS = PathQueryOptions(accepted_chance=1.0)
WAY = np.column_stack([np.linspace(-1.5, 1.5, 151), np.zeros((151, 2))])


@pytest.mark.parametrize("policy", ["equal", "optimal", "servo"])
@pytest.mark.parametrize("ground", [rocky(5), make_terrain(waves)], ids=["rocks", "waves"])
def test_a_path_judged_in_part_after_a_change_of_the_map_is_as_one_judged_whole(ground, policy):
    options, memory, rng = OPTIONS.change(policy=policy), EdgeMemory(), np.random.default_rng(3)
    for _ in range(12):
        site = Site(LSR1, ground, options)
        judge = memory.begin(site)
        part, whole = judge.check(WAY), PathJudge(site).check(WAY)
        assert repr(part.verdict) == repr(whole.verdict)  # NaN is not equal to NaN
        assert_same(part.prediction, whole.prediction)
        assert_same(part.prediction.between, whole.prediction.between)
        # Other or unknown heights in a rectangle anywhere.
        rows, columns = (np.sort(rng.integers(0, size + 1, 2)) for size in ground.elevation.shape)
        changed = slice(*rows), slice(*np.minimum(columns, columns[0] + 20))
        rough = rng.normal(0.0, 0.05, ground.elevation[changed].shape)
        ground = raised(ground, changed, (rough, 3.0, np.nan)[rng.integers(3)])


def test_where_forgetting_fails_the_next_search_knows_nothing_of_the_old_map(monkeypatch):
    ground, memory = make_terrain(waves), EdgeMemory()
    memory.begin(Site(LSR1, ground, OPTIONS)).check(WAY)
    site = Site(LSR1, raised(ground, np.s_[:, :], 0.3 * np.eye(*ground.elevation.shape)), OPTIONS)
    with monkeypatch.context() as patch:
        patch.setattr(edge_memory, "find_changes", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            memory.begin(site)
    judge = memory.begin(site)
    assert repr(judge.check(WAY).verdict) == repr(PathJudge(site).check(WAY).verdict)


def test_a_map_with_friction_is_packed_for_the_first_search_alone():
    ground = make_terrain(waves)
    ground = replace(ground, friction=np.full(ground.elevation.shape, 0.8))
    packed = []
    for _ in range(2):
        PathJudge(Site(LSR1, ground)).judge_pieces([Piece(WAY, Gear.FORWARD)])
        packed.append(pack_ground.cache_info().misses)
    assert packed[0] == packed[1]


def test_no_place_near_a_changed_cell_is_overlooked_and_none_farther_than_two_cells_is_taken():
    rng, ground = np.random.default_rng(1), make_terrain(waves)
    cell, (ny, nx) = ground.resolution, ground.elevation.shape
    for reach in (0.0, 0.31, 1.234):
        changed = rng.random((ny, nx)) < 3.0 / (ny * nx)
        changed[0, 0] = True
        x, y = (
            origin + cell * k
            for origin, k in zip(ground.origin, np.nonzero(changed)[::-1], strict=True)
        )
        places = rng.uniform(*np.reshape(ground.bounds, (2, 2)).T, (5000, 2))
        aside = np.maximum(abs(places[:, :1] - x), abs(places[:, 1:] - y)).min(axis=1)
        near = _look_near(changed, ground, reach)(places)
        assert near[aside <= reach].all() and not near[aside > reach + 2.0 * cell].any()
