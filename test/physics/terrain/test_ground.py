# SPDX-License-Identifier: Apache-2.0
"""A packed terrain: block maxima, unknown cells, and addresses that stay good."""

import gc
import pickle
import weakref

import numpy as np
import pytest

from rover_physics.prediction.packed_model import pack_model
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import (
    BLOCK,
    SOIL_NUMBERS,
    address_of,
    copy_soil,
    friction_at,
    height_inside,
    pack_ground,
    with_soils,
)


@pytest.mark.parametrize("shape", [(8, 12), (9, 15), (2, 3), (41, 30)])
def test_blocks_hold_the_highest_ground(shape):
    rng = np.random.default_rng(5)
    elevation = rng.normal(size=shape)
    elevation[rng.random(shape) < 0.2] = np.nan
    elevation[0, 0], elevation[-1, -1] = 0.3, np.nan
    packed = pack_ground(Terrain(elevation, 0.1))
    for i in range(-(-shape[0] // BLOCK)):
        for j in range(-(-shape[1] // BLOCK)):
            block = elevation[i * BLOCK : (i + 1) * BLOCK, j * BLOCK : (j + 1) * BLOCK]
            unknown = np.isnan(block)
            assert packed.arrays["block_max"][i, j] == (np.inf if unknown.any() else block.max())
            assert packed.arrays["known_block_max"][i, j] == block[~unknown].max(initial=-np.inf)
    for name in ("block_max", "known_block_max"):
        assert packed.arrays[name].shape == (i + 1, j + 1)


def test_an_edit_of_the_array_that_was_given_does_not_reach_the_ground():
    """A table of block maxima that is older than the heights would hide obstacles."""
    heights = np.zeros((9, 9))
    terrain = Terrain(heights, 0.1)
    packed = pack_ground(terrain)
    heights[4, 4] = 5.0
    assert terrain.elevation[4, 4] == packed.arrays["elevation"][4, 4] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        terrain.elevation[4, 4] = 5.0
    with pytest.raises(ValueError, match="read-only"):
        terrain.elevation.flat[0] = 5.0


def test_an_address_is_given_of_arrays_of_the_right_type_without_gaps_alone():
    with pytest.raises(TypeError, match="float32"):
        address_of(np.zeros((2, 2), np.float32), np.float64)
    with pytest.raises(TypeError, match="int64"):
        address_of(np.zeros((2, 2), np.int64), np.int32)
    with pytest.raises(TypeError, match=">f8"):
        address_of(np.zeros((2, 2), ">f8"), np.float64)
    with pytest.raises(ValueError, match="C-contiguous"):
        address_of(np.zeros((4, 4))[:, ::2], np.float64)


def test_a_ground_outlives_its_terrain():
    """The record holds addresses: whoever has the Ground has the arrays."""
    terrain = Terrain(np.full((40, 40), 0.25), 0.1, friction=np.full((40, 40), 0.6))
    watched = weakref.ref(terrain)
    ground = pack_ground.__wrapped__(terrain)
    del terrain
    gc.collect()
    assert watched() is None
    _ = [np.full((40, 40), -1.0) for _ in range(50)]  # would take the place of what is freed
    assert height_inside(ground.records[0], 10.3, 20.7) == 0.25
    assert friction_at(ground.records[0], 1.0, 2.0, 0.9) == 0.6


def test_a_ground_with_other_soils_keeps_them():
    ground = pack_ground(Terrain(np.zeros((4, 4)), 0.1))
    other = with_soils(ground, np.full((1, SOIL_NUMBERS), 7.0))
    gc.collect()
    soil = np.empty(SOIL_NUMBERS)
    copy_soil(other.records[0], 0, soil)
    assert soil.tolist() == [7.0] * SOIL_NUMBERS
    copy_soil(ground.records[0], 0, soil)
    assert soil.tolist() == [0.0] * SOIL_NUMBERS


def test_addresses_do_not_leave_the_process():
    terrain = Terrain(np.zeros((4, 4)), 0.1)
    with pytest.raises(TypeError, match="pickle its Terrain"):
        pickle.dumps(pack_ground(terrain))
    with pytest.raises(TypeError, match="rover, terrain and options"):
        pickle.dumps(pack_model(load_rover("lsr1"), terrain))
    again = pickle.loads(pickle.dumps(terrain))
    assert again.elevation.tobytes() == terrain.elevation.tobytes()
