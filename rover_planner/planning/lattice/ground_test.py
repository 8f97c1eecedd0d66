"""The test that costs almost nothing: nodes where a wheel would surely stand on unknown ground.

The model refuses these poses, so that no edge that begins or ends there is judged.
"""

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.lattice.headings import HEADINGS, YAWS
from rover_planner.planning.lattice.nodes import Nodes

_ROUNDING = 1e-6
"""Distance from the edge of the map [m] that counts as on it."""


def find_groundless(rover: Rover, terrain: Terrain, nodes: Nodes) -> NDArray[np.bool_]:
    """Return (nodes,) True where the centre of a wheel is over unknown ground or off the map."""
    known = _known_squares(terrain)
    own = np.array([place[:2] for place in rover.suspension.wheels.values()])
    wheels = np.concatenate([own, own * (1.0, -1.0)])
    c, s = np.cos(YAWS)[:, None], np.sin(YAWS)[:, None]
    x, y = c * wheels[:, 0] - s * wheels[:, 1], s * wheels[:, 0] + c * wheels[:, 1]
    offsets = np.stack([x, y], axis=-1) - terrain.origin
    groundless = np.zeros(nodes.count, bool)
    window = nodes.cell, nodes.first[0], nodes.first[1], nodes.shape[1]
    mark_groundless(known, terrain.resolution, offsets, window, groundless)
    return groundless


def _known_squares(terrain: Terrain) -> NDArray[np.bool_]:
    """Return (ny - 1, nx - 1) True where all four corners between cell centres are known."""
    known = np.isfinite(terrain.elevation)
    return known[1:, 1:] & known[:-1, 1:] & known[1:, :-1] & known[:-1, :-1]


@exact_kernel
def mark_groundless(known, resolution, offsets, window, groundless):
    """Write True for nodes with a wheel centre outside the known squares.

    Args:
        known: (ny - 1, nx - 1) True where the ground between four cell centres is known.
        resolution: Cell size of the map [m].
        offsets: (HEADINGS, 6, 2) wheel centres at a node at the map frame's origin, from the
            centre of the map's first cell [m].
        window: Cell [m], first column and row, and number of columns of the nodes.
        groundless: (nodes,), written where True.
    """
    cell, first_column, first_row, columns = window
    ny, nx = known.shape
    margin = _ROUNDING / resolution
    for node in range(groundless.size):
        heading, place = node % HEADINGS, node // HEADINGS
        x = cell * (place % columns + first_column)
        y = cell * (place // columns + first_row)
        for wheel in range(6):
            u = (x + offsets[heading, wheel, 0]) / resolution
            v = (y + offsets[heading, wheel, 1]) / resolution
            if not (-margin <= u <= nx + margin and -margin <= v <= ny + margin):
                groundless[node] = True
                break
            i, j = min(max(int(u), 0), nx - 1), min(max(int(v), 0), ny - 1)
            on_line = min(u - i, i + 1 - u, v - j, j + 1 - v) < margin
            if not (known[j, i] or on_line):
                groundless[node] = True
                break
