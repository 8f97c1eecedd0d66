# SPDX-License-Identifier: Apache-2.0
"""The cells in which two maps differ are found, whatever their layers and their grids."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.terrain.grid import Terrain
from rover_planner.maps.changes import find_changes, find_overlap, have_same_layers


def ground(seed=0, shape=(12, 15)) -> Terrain:
    rng = np.random.default_rng(seed)
    elevation = rng.standard_normal(shape)
    elevation[3, 4] = np.nan
    return Terrain(elevation, 0.1, (0.0, 0.0), friction=rng.uniform(0.2, 1.0, shape))


@pytest.mark.parametrize("layer", ["elevation", "friction"])
@pytest.mark.parametrize("value", [9.0, np.nan])
def test_a_cell_of_any_layer_that_differs_is_found(layer, value):
    assert not find_changes(ground(), ground()).any()
    values = getattr(ground(), layer).copy()
    values[7, 2] = value
    found = find_changes(ground(), replace(ground(), **{layer: values}))
    assert found.shape == (14, 17) and np.argwhere(found).tolist() == [[8, 3]]
    back = find_changes(replace(ground(), **{layer: values}), ground())
    assert np.argwhere(back).tolist() == [[8, 3]]


@pytest.mark.parametrize("shift", [(2, -3), (40, 0)])
def test_in_a_window_that_moved_only_new_cells_and_the_edge_differ(shift):
    whole = np.random.default_rng(1).standard_normal((60, 60))
    old = Terrain(whole[20:32, 20:35], 0.1, (0.0, 0.0))
    rows, columns = shift
    part = whole[20 + rows :, 20 + columns :][:12, :15]
    new = Terrain(np.resize(part, (12, 15)), 0.1, (0.1 * columns, 0.1 * rows))
    found = find_changes(old, new, shift)
    inside, now = np.ones((12, 15), bool), find_overlap(old, new, shift)[1]
    inside[now] = False
    np.testing.assert_array_equal(found[1:-1, 1:-1], inside)
    assert found[[0, -1]].all() and found[:, [0, -1]].all()


def test_layers_and_soils_must_be_the_same():
    assert have_same_layers(ground(), ground(5))
    assert not have_same_layers(ground(), replace(ground(), friction=None))
    soil = np.zeros((12, 15), np.int32)
    sand = replace(ground(), soil=soil, soil_names=("mars_simulant",))
    assert not have_same_layers(ground(), sand)
