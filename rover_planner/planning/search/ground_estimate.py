# SPDX-License-Identifier: Apache-2.0
"""Cheap estimates of all nodes, from the heights below the wheels without the model.

Nodes where the centre of a wheel is over unknown ground however the rover tilts are refused, as
the model does. Nodes with unknown ground below a wheel on level ground are only doubted: the model
decides, but it is asked about other paths first.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.search.cell_counts import CellCounts
from rover_planner.planning.search.nodes import HEADINGS, YAWS, Nodes

FULL_DOUBT = 4.0
"""Doubt of nodes near unknown ground: edges that lead there cost 1 + that as much while the search
is cautious."""
_ROUNDING = 1e-4
"""Distance from the edge of the map [cells] that counts as on it."""


class LatticeGround(NamedTuple):
    """Estimates of all nodes."""

    groundless: NDArray[np.bool_]
    """(nodes,) whether the centre of a wheel is over unknown ground or off the map in any case."""
    doubt: NDArray[np.float32]
    """(nodes,) doubt that the rover can be there, 0 or FULL_DOUBT."""


class _Question(NamedTuple):
    """A map, and where the wheels of a rover at a node are, as the kernel reads it."""

    whole: np.ndarray
    """(ny - 1, nx - 1) whether all corners of a cell are known."""
    away: np.ndarray
    """(ny, nx) distance to the next known cell [m]."""
    resolution: float
    """Cell size [m]."""
    offsets: np.ndarray
    """(HEADINGS, 6, 2) wheel centres at a node at the map frame's origin, from the centre of the
    map's first cell [m]."""
    shift: float
    """Largest distance of a wheel centre from its place on level ground [m], seen from above."""


def estimate_ground(rover: Rover, terrain: Terrain, nodes: Nodes) -> LatticeGround:
    """Estimate all nodes.

    Args:
        rover: The rover.
        terrain: The ground.
        nodes: The nodes.
    """
    wheels = wheel_places(rover)
    known = ~np.isnan(terrain.elevation)
    away = np.zeros(known.shape) if known.all() else ndimage.distance_transform_edt(~known)
    question = _Question(
        known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:],
        terrain.resolution * away,
        terrain.resolution,
        wheels - terrain.origin,
        largest_wheel_shift(rover),
    )
    found = LatticeGround(np.zeros(nodes.count, bool), np.zeros(nodes.count, np.float32))
    at = nodes.poses(np.arange(0, nodes.count, HEADINGS))[:, :2]
    reach = swing_radius(rover)
    low, high = np.reshape(terrain.bounds, (2, 2)).T
    doubtful = ((at - reach < low) | (at + reach > high)).any(axis=1)
    doubtful |= CellCounts(terrain, ~known).are_near(at, reach)
    estimate_nodes(question, at, np.flatnonzero(doubtful), found)
    return found


def wheel_places(rover: Rover) -> NDArray[np.float64]:
    """Return (HEADINGS, 6, 2) x, y [m] of the wheel centres at a node at the origin, level."""
    own = np.array([place[:2] for place in rover.suspension.wheels.values()])
    places = np.concatenate([own, own * (1.0, -1.0)])
    c, s = np.cos(YAWS)[:, None], np.sin(YAWS)[:, None]
    x, y = c * places[:, 0] - s * places[:, 1], s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y], axis=-1)


def largest_wheel_shift(rover: Rover) -> float:
    """Return how far a wheel centre may be from its place on level ground [m], seen from above.

    Body, rocker and bogie each turn by what their limits allow at most.
    """
    suspension, tilt = rover.suspension, rover.limits.tilt
    rocking, turning = (
        min(max(map(abs, limits)), 0.5 * math.pi)
        for limits in (suspension.rocker_limits, suspension.bogie_limits)
    )
    farthest = 0.0
    for name, wheel in suspension.wheels.items():
        links = [(suspension.rocker_pivot, wheel, rocking)]
        if name in suspension.bogie_wheels:
            both = min(rocking + turning, 0.5 * math.pi)
            links = [
                (suspension.rocker_pivot, suspension.bogie_pivot, rocking),
                (suspension.bogie_pivot, wheel, both),
            ]
        along = up = 0.0
        for pivot, end, angle in links:
            x, z = abs(end[0] - pivot[0]), abs(end[2] - pivot[2])
            along += x * (1.0 - math.cos(angle)) + z * math.sin(angle)
            up += z * (1.0 - math.cos(angle)) + x * math.sin(angle)
        level = math.hypot(wheel[0], wheel[1]) + along
        tilted = level * (1.0 - math.cos(tilt)) + (abs(wheel[2]) + up) * math.sin(tilt)
        farthest = max(farthest, along + tilted)
    return farthest


@exact_kernel
def estimate_nodes(question, at, chosen, found):
    """Write the estimates of the nodes at some places.

    Args:
        question: _Question.
        at: (n, 2) x and y of all places [m].
        chosen: (k,) the places to look at.
        found: LatticeGround of zeros, written where it differs.
    """
    for place in chosen:
        for heading in range(HEADINGS):
            node = place * HEADINGS + heading
            for wheel in range(6):
                u = (at[place, 0] + question.offsets[heading, wheel, 0]) / question.resolution
                v = (at[place, 1] + question.offsets[heading, wheel, 1]) / question.resolution
                if not _is_known(question.whole, u, v):
                    found.doubt[node] = FULL_DOUBT
                    if _distance(question, u, v) > question.shift:
                        found.groundless[node] = True
                        break


@exact_kernel
def _distance(question, u, v):
    """Return a bound from below on the distance from a place [cells] to known ground [m]."""
    ny, nx = question.away.shape
    i, j = min(max(int(u + 0.5), 0), nx - 1), min(max(int(v + 0.5), 0), ny - 1)
    beyond = question.resolution * np.hypot(u - i, v - j)
    return max(beyond, question.away[j, i] - beyond) - question.resolution


@exact_kernel
def _is_known(whole, u, v):
    """Return whether a place [cells] is on the map, and all corners around it are known."""
    ny, nx = whole.shape
    on_map = -_ROUNDING <= u <= nx + _ROUNDING and -_ROUNDING <= v <= ny + _ROUNDING
    return on_map and whole[min(int(v), ny - 1), min(int(u), nx - 1)]
