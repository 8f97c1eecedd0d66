"""A packed terrain: blocks hold the highest ground, unknown cells count as told."""

import numpy as np
import pytest

from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import BLOCK, pack_ground


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
            assert packed.block_max[i, j] == (np.inf if unknown.any() else block.max())
            assert packed.known_block_max[i, j] == block[~unknown].max(initial=-np.inf)
    assert packed.block_max.shape == packed.known_block_max.shape == (i + 1, j + 1)
