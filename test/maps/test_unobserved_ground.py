# SPDX-License-Identifier: Apache-2.0
"""The share of never seen ground under the belly is counted along a path, cell by cell."""

import time
from dataclasses import replace

import numpy as np
import pytest

from rover_physics import Terrain
from rover_planner.maps.layers import FOOTPRINT, CellSources
from rover_planner.maps.unobserved_ground import (
    ALLOW,
    ALLOW_FOOTPRINT,
    REFUSE,
    SEEN,
    UNSEEN,
    ObservedGround,
    observed_ground,
)
from support.rovers import LSR1

PATH = np.column_stack([np.arange(0.0, 2.0, 0.02), np.zeros(100), np.zeros(100)])
SHAPE = (81, 161)
LEVEL = Terrain(np.zeros(SHAPE), 0.05, (-2.0, -2.0))
X = -2.0 + 0.05 * np.arange(161)
"""Where the columns of cells are [m]."""


def test_the_share_is_that_of_the_cells_under_the_belly():
    elevation = np.zeros(SHAPE)
    elevation[:, (X >= 1.0) & (X < 1.5)] = np.nan
    share = observed_ground(replace(LEVEL, elevation=elevation), None).share(LSR1, PATH)
    # The belly, 0.6 m x 0.4 m, sweeps x from -0.3 to 2.28 m: 53 columns of cells, 10 of them
    # unknown.
    assert share.unobserved_share == pytest.approx(10 / 53, abs=0.01)
    assert share.footprint_share == 0.0
    assert PATH[share.first, 0] == pytest.approx(0.7, abs=0.04)


def test_the_start_footprint_is_told_apart():
    source = np.full(SHAPE, 4, np.uint8)
    source[:, X < 0.5] = FOOTPRINT
    sources = CellSources(source, np.zeros(SHAPE))
    share = observed_ground(LEVEL, sources).share(LSR1, PATH)
    assert share.unobserved_share == share.footprint_share == pytest.approx(16 / 53, abs=0.02)
    assert share.first == 0 and share.first_beyond_footprint == -1
    assert [share.first_refused(rule) for rule in (ALLOW, ALLOW_FOOTPRINT, REFUSE)] == [-1, -1, 0]


def test_ground_off_the_map_was_not_seen_and_a_long_path_there_takes_no_time():
    x, seen = np.arange(0.0, 20_000.0, 0.02), observed_ground(LEVEL, None)
    path = np.column_stack([x, 0.0 * x, 0.0 * x])
    began = time.process_time()
    share = seen.share(LSR1, path)
    assert time.process_time() - began < 2.0
    assert share.first == share.first_beyond_footprint
    assert 5.6 < path[share.first, 0] + 0.3 + 0.06 < 6.2
    assert share.unobserved_share == 0.0  # the shares are those of cells on the map
    away = seen.share(LSR1, PATH + np.array([1e7, 0.0, 0.0]))
    assert (away.unobserved_share, away.first) == (1.0, 0)


def test_a_long_path_counts_each_cell_once():
    kinds = np.full(SHAPE, SEEN, np.uint8)
    kinds[:, 60] = UNSEEN
    seen = ObservedGround(LEVEL, kinds)
    beside = np.full(SHAPE, SEEN, np.uint8)
    beside[46:] = UNSEEN  # y of 0.3 m and more; the belly ends at 0.2 m
    assert ObservedGround(LEVEL, beside).share(LSR1, PATH).unobserved_share == 0.0
    often = np.vstack([PATH] * 30)
    whole, once = seen.share(LSR1, often), seen.share(LSR1, PATH)
    assert whole.unobserved_share == once.unobserved_share > 0.0 and whole.first == once.first
