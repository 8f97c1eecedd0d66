# SPDX-License-Identifier: Apache-2.0
"""Belly clearance: the smallest height of the body's underside above the ground."""

from typing import NamedTuple

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import BLOCK, elevation_of, known_max_of_block, look_up

HALF = 0.5 * (BLOCK - 1)
"""Distance of a block's outer rows and columns from its middle [cells]."""
POINTS = 9
"""Number of points of the underside: corners, middles of edges and centre."""


class Underside(NamedTuple):
    """The underside's plane above the cells of a map, linear in row i and column j.

    Each is (value at cell [0, 0], change per row, change per column) [m].
    """

    z: tuple[float, float, float]
    """Height of the plane, map frame."""
    along: tuple[float, float, float]
    """Body x of the plane's point above a cell."""
    across: tuple[float, float, float]
    """Body y of the plane's point above a cell."""


@kernel
def belly_clearance(ground, linkage, placement):
    """Return the smallest height [m] of the underside above the known ground below it.

    The heights are those of all cell centres within the outline of the underside. If none of them
    is known, as with large cells, nine points of the underside are used; NaN if their ground is
    unknown, too, or if the body is upside down. Blocks whose highest ground is farther below than
    the result so far are skipped.

    Args:
        ground: GROUND.
        linkage: LINKAGE; `belly` is (height, rear, front, right, left) of the underside [m], body
            frame.
        placement: PLACEMENT of the settled rover.
    """
    R, origin, belly = placement.R, placement.origin, linkage.belly
    if not R[2, 2] > 0.0:
        return np.nan
    plane = _describe_underside(ground, R, origin, belly)
    low_i, high_i, low_j, high_j = _blocks_below(ground, R, origin, belly)
    smallest = np.inf
    for bi in range(low_i, high_i + 1):
        for bj in range(low_j, high_j + 1):
            bound = _lowest_above(plane, bi, bj) - known_max_of_block(ground, bi, bj)
            if bound < smallest and _is_below(plane, belly, bi, bj):
                smallest = _clear_block(ground, plane, belly, bi, bj, smallest)
    return smallest if smallest < np.inf else _clear_points(ground, R, origin, belly)


@kernel
def _clear_points(ground, R, origin, belly):
    """Return the smallest clearance [m] at the points of the underside, NaN if none is known."""
    smallest = np.inf
    for k in range(POINTS):
        x, y, z = point_of_underside(R, origin, belly, k)
        clearance = z - look_up(ground, x, y)[0]
        if clearance < smallest:
            smallest = clearance
    return smallest if smallest < np.inf else np.nan


@kernel
def point_of_underside(R, origin, belly, k):
    """Return x, y, z [m] of point k of POINTS on the underside, map frame."""
    along = belly[1] + 0.5 * (k % 3) * (belly[2] - belly[1])
    across = belly[3] + 0.5 * (k // 3) * (belly[4] - belly[3])
    return (
        origin[0] + R[0, 0] * along + R[0, 1] * across + R[0, 2] * belly[0],
        origin[1] + R[1, 0] * along + R[1, 1] * across + R[1, 2] * belly[0],
        origin[2] + R[2, 0] * along + R[2, 1] * across + R[2, 2] * belly[0],
    )


@kernel
def _describe_underside(ground, R, origin, belly):
    cell = 1.0 / ground.inverse_resolution
    dx, dy = ground.x0 - origin[0], ground.y0 - origin[1]
    rise_x, rise_y = -R[0, 2] / R[2, 2], -R[1, 2] / R[2, 2]
    z = belly[0] / R[2, 2] + rise_x * dx + rise_y * dy
    z_i, z_j = rise_y * cell, rise_x * cell
    return Underside(
        (origin[2] + z, z_i, z_j),
        (
            R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * z,
            R[1, 0] * cell + R[2, 0] * z_i,
            R[0, 0] * cell + R[2, 0] * z_j,
        ),
        (
            R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * z,
            R[1, 1] * cell + R[2, 1] * z_i,
            R[0, 1] * cell + R[2, 1] * z_j,
        ),
    )


@kernel
def _at(linear, i, j):
    """Return a value of an Underside at a place (row, column)."""
    return linear[0] + linear[1] * i + linear[2] * j


@kernel
def _lowest_above(plane, bi, bj):
    """Return the lowest height [m] of the underside's plane above a block of cells."""
    i = BLOCK * bi + (0 if plane.z[1] > 0.0 else BLOCK - 1)
    j = BLOCK * bj + (0 if plane.z[2] > 0.0 else BLOCK - 1)
    return _at(plane.z, i, j)


@kernel
def _is_below(plane, belly, bi, bj):
    """Return whether any cell of a block may be below the underside."""
    i, j = BLOCK * bi + HALF, BLOCK * bj + HALF
    beyond = HALF * (abs(plane.along[1]) + abs(plane.along[2]))
    aside = HALF * (abs(plane.across[1]) + abs(plane.across[2]))
    return (
        belly[1] - beyond <= _at(plane.along, i, j) <= belly[2] + beyond
        and belly[3] - aside <= _at(plane.across, i, j) <= belly[4] + aside
    )


@kernel
def _clear_block(ground, plane, belly, bi, bj, smallest):
    """Return the smaller of `smallest` and the clearance above a block of cells [m]."""
    for i in range(BLOCK * bi, min(BLOCK * (bi + 1), ground.rows)):
        for j in range(BLOCK * bj, min(BLOCK * (bj + 1), ground.columns)):
            clearance = _at(plane.z, i, j) - elevation_of(ground, i, j)
            if clearance < smallest:
                along, across = _at(plane.along, i, j), _at(plane.across, i, j)
                if belly[1] <= along <= belly[2] and belly[3] <= across <= belly[4]:
                    smallest = clearance
    return smallest


@kernel
def _blocks_below(ground, R, origin, belly):
    """Return first and last row, first and last column of the blocks below the underside."""
    low_x = low_y = np.inf
    high_x = high_y = -np.inf
    for k in (0, 2, 6, 8):
        x, y, _ = point_of_underside(R, origin, belly, k)
        low_x, high_x = min(low_x, x), max(high_x, x)
        low_y, high_y = min(low_y, y), max(high_y, y)
    scale = ground.inverse_resolution
    last_i, last_j = ground.block_rows - 1, ground.block_columns - 1
    return (
        max(int(np.floor((low_y - ground.y0) * scale)) // BLOCK, 0),
        min(int(np.ceil((high_y - ground.y0) * scale)) // BLOCK, last_i),
        max(int(np.floor((low_x - ground.x0) * scale)) // BLOCK, 0),
        min(int(np.ceil((high_x - ground.x0) * scale)) // BLOCK, last_j),
    )
