"""How far the belly of the body stays above the ground."""

import numpy as np

from rover_physics.ground import BLOCK
from rover_physics.kernels import kernel


@kernel
def belly_clearance(ground, linkage, placement):
    """Return the smallest height [m] of the underside above the known ground below it.

    Looked up at all cell centres within the outline of the underside; NaN where none is known
    there. Blocks of cells are passed over whose highest ground stays below what is found already.
    """
    R, origin, belly = placement.R, placement.origin, linkage.belly
    blocks = ground.block_ceiling
    if not R[2, 2] > 0.0:
        return np.nan
    low_i, high_i, low_j, high_j = _cells_below(ground, R, origin, belly)
    smallest = np.inf
    for bi in range(max(low_i // BLOCK, 0), min(high_i // BLOCK, blocks.shape[0] - 1) + 1):
        for bj in range(max(low_j // BLOCK, 0), min(high_j // BLOCK, blocks.shape[1] - 1) + 1):
            if _lowest_above(ground, R, origin, belly, bi, bj) - blocks[bi, bj] < smallest:
                smallest = min(smallest, _clear_block(ground, R, origin, belly, bi, bj))
    return smallest if smallest < np.inf else np.nan


@kernel
def _lowest_above(ground, R, origin, belly, bi, bj):
    """Return the lowest height [m] of the underside's plane above a block of cells."""
    half = 0.5 * (BLOCK - 1) / ground.inverse_resolution
    dx = ground.x0 + BLOCK * bj / ground.inverse_resolution + half - origin[0]
    dy = ground.y0 + BLOCK * bi / ground.inverse_resolution + half - origin[1]
    z = (belly[0] - R[0, 2] * dx - R[1, 2] * dy) / R[2, 2]
    return origin[2] + z - half * (abs(R[0, 2]) + abs(R[1, 2])) / R[2, 2]


@kernel
def _clear_block(ground, R, origin, belly, bi, bj):
    """Return the smallest clearance [m] above the cells of a block below the underside."""
    elevation, scale = ground.elevation, ground.inverse_resolution
    smallest = np.inf
    for i in range(BLOCK * bi, min(BLOCK * (bi + 1), elevation.shape[0])):
        for j in range(BLOCK * bj, min(BLOCK * (bj + 1), elevation.shape[1])):
            dx = ground.x0 + j / scale - origin[0]
            dy = ground.y0 + i / scale - origin[1]
            z = (belly[0] - R[0, 2] * dx - R[1, 2] * dy) / R[2, 2]
            clearance = origin[2] + z - elevation[i, j]
            if clearance < smallest:
                along = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * z
                across = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * z
                if belly[1] <= along <= belly[2] and belly[3] <= across <= belly[4]:
                    smallest = clearance
    return smallest


@kernel
def _cells_below(ground, R, origin, belly):
    """Return the smallest and largest row and column of the cells around the underside."""
    low_x = low_y = np.inf
    high_x = high_y = -np.inf
    for corner in range(4):
        along = belly[1 + corner % 2]
        across = belly[3 + corner // 2]
        x = origin[0] + R[0, 0] * along + R[0, 1] * across + R[0, 2] * belly[0]
        y = origin[1] + R[1, 0] * along + R[1, 1] * across + R[1, 2] * belly[0]
        low_x, high_x = min(low_x, x), max(high_x, x)
        low_y, high_y = min(low_y, y), max(high_y, y)
    scale = ground.inverse_resolution
    return (
        int(np.ceil((low_y - ground.y0) * scale)),
        int(np.floor((high_y - ground.y0) * scale)),
        int(np.ceil((low_x - ground.x0) * scale)),
        int(np.floor((high_x - ground.x0) * scale)),
    )
