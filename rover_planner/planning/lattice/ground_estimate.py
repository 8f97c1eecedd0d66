"""Cheap estimates of all nodes, from the heights below the wheels without the model.

Nodes where the centre of a wheel is over unknown ground are refused, as the model does. Steep
ground is only doubted: the model decides, but it is asked about other ways first.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.lattice.headings import HEADINGS, YAWS
from rover_planner.planning.lattice.nodes import Nodes

FULL_DOUBT = 4.0
"""Doubt of ground that is as steep as the rover can climb: edges that lead there cost 1 + that as
much while the search is cautious."""
STEEP = 0.4
"""Share of that steepness from where on ground is doubted."""
UNEVEN = 0.5
"""Weight of the slopes at the wheels beside that of the ground as a whole."""
_ROUNDING = 1e-6
"""Distance from the edge of the map [m] that counts as on it."""


class GroundEstimate(NamedTuple):
    """Estimates of all nodes."""

    groundless: NDArray[np.bool_]
    """(nodes,) whether the centre of a wheel is over unknown ground or off the map."""
    doubt: NDArray[np.float32]
    """(nodes,) doubt that the rover can be there, 0 to FULL_DOUBT."""


class _Map(NamedTuple):
    """A map as the kernel reads it."""

    elevation: np.ndarray
    """(ny, nx) heights [m]."""
    slope: np.ndarray
    """(ny, nx) slope at the size of a wheel [rise over run]; NaN where unknown."""
    resolution: float
    """Cell size [m]."""


class _Wheels(NamedTuple):
    """Where the wheels of a rover at a node are."""

    offsets: np.ndarray
    """(HEADINGS, 6, 2) wheel centres at a node at the map frame's origin, from the centre of the
    map's first cell [m]."""
    plane: np.ndarray
    """(2, 6) weights of the heights below the wheels in the slopes of the plane through them."""


def estimate_ground(
    rover: Rover, terrain: Terrain, nodes: Nodes, friction: float
) -> GroundEstimate:
    """Estimate all nodes.

    Args:
        rover: The rover.
        terrain: The ground.
        nodes: The nodes.
        friction: Friction coefficient where the terrain has none.
    """
    own = np.array([place[:2] for place in rover.suspension.wheels.values()])
    places = np.concatenate([own, own * (1.0, -1.0)])
    c, s = np.cos(YAWS)[:, None], np.sin(YAWS)[:, None]
    x, y = c * places[:, 0] - s * places[:, 1], s * places[:, 0] + c * places[:, 1]
    plane = np.linalg.pinv(np.column_stack([np.ones(6), places]))[1:]
    wheels = _Wheels(np.stack([x, y], axis=-1) - terrain.origin, np.ascontiguousarray(plane))
    ground = _Map(
        np.asarray(terrain.elevation), _slopes(terrain, rover.wheel.radius), terrain.resolution
    )
    found = GroundEstimate(np.zeros(nodes.count, bool), np.zeros(nodes.count, np.float32))
    window = nodes.cell, nodes.first[0], nodes.first[1], nodes.shape[1]
    estimate_nodes(ground, wheels, window, steepest_climb(rover, friction), found)
    return found


def steepest_climb(rover: Rover, friction: float) -> float:
    """Return the slope [rise over run] at which friction, torque or tilt end a climb."""
    limits = rover.limits
    pull = 6.0 * rover.wheel.max_torque * limits.torque_saturation / rover.wheel.radius
    by_torque = math.tan(math.asin(min(pull / rover.weight, 0.99)))
    return min(friction * limits.friction_utilisation, by_torque, math.tan(limits.tilt))


def _slopes(terrain: Terrain, radius: float) -> NDArray[np.float64]:
    """Return (ny, nx) slopes between points about one wheel radius to all sides, NaN at edges."""
    step = max(1, round(radius / terrain.resolution))
    z, slopes = terrain.elevation, np.full(terrain.elevation.shape, np.nan)
    if min(z.shape) <= 2 * step:
        return slopes
    inner = slice(step, -step)
    run = 2.0 * step * terrain.resolution
    along_x = (z[inner, 2 * step :] - z[inner, : -2 * step]) / run
    along_y = (z[2 * step :, inner] - z[: -2 * step, inner]) / run
    slopes[inner, inner] = np.hypot(along_x, along_y)
    return slopes


@exact_kernel
def estimate_nodes(ground, wheels, window, climb, found):
    """Write the estimates of all nodes.

    Args:
        ground: _Map.
        wheels: _Wheels.
        window: Cell [m], first column and row, and number of columns of the nodes.
        climb: Slope at which a climb ends [rise over run].
        found: GroundEstimate of zeros, written where it differs.
    """
    cell, first_column, first_row, columns = window
    ny, nx = ground.elevation.shape
    edge = _ROUNDING / ground.resolution
    for node in range(found.doubt.size):
        heading, place = node % HEADINGS, node // HEADINGS
        x = cell * (place % columns + first_column)
        y = cell * (place // columns + first_row)
        pitch, roll, uneven = 0.0, 0.0, 0.0
        for wheel in range(6):
            u = (x + wheels.offsets[heading, wheel, 0]) / ground.resolution
            v = (y + wheels.offsets[heading, wheel, 1]) / ground.resolution
            if not (-edge <= u <= nx - 1 + edge and -edge <= v <= ny - 1 + edge):
                found.groundless[node] = True
                break
            if not _is_known(ground.elevation, u, v):
                found.groundless[node] = True
                break
            i, j = int(u + 0.5), int(v + 0.5)
            height, slope = ground.elevation[j, i], ground.slope[j, i]
            if height == height:
                pitch += wheels.plane[0, wheel] * height
                roll += wheels.plane[1, wheel] * height
            if slope == slope:
                uneven += slope / 6.0
        if not found.groundless[node]:
            steepness = (np.hypot(pitch, roll) + UNEVEN * uneven) / ((1.0 + UNEVEN) * climb)
            share = min(max((steepness - STEEP) / (1.0 - STEEP), 0.0), 1.0)
            found.doubt[node] = FULL_DOUBT * share


@exact_kernel
def _is_known(elevation, u, v):
    """Return whether the ground at a place [cells] is known: all corners around it are.

    Within rounding of a line between cells, the corners on one side of it suffice.
    """
    i, j = min(int(u), elevation.shape[1] - 2), min(int(v), elevation.shape[0] - 2)
    a, b = u - i, v - j
    known = True
    for row in range(2):
        for column in range(2):
            weight = (a if column else 1.0 - a) * (b if row else 1.0 - b)
            if weight > 1e-4 and np.isnan(elevation[j + row, i + column]):
                known = False
    return known
