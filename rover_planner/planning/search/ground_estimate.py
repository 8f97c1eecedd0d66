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

from rover_physics.numerics.arrays import Floats
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


def estimate_ground(rover: Rover, terrain: Terrain, nodes: Nodes) -> LatticeGround:
    """Estimate all nodes.

    Args:
        rover: The rover.
        terrain: The ground.
        nodes: The nodes.
    """
    known = ~np.isnan(terrain.elevation)
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]
    away = np.zeros(known.shape) if known.all() else ndimage.distance_transform_edt(~known)
    at = nodes.poses(np.arange(0, nodes.count, HEADINGS))[:, :2]
    reach, shift = swing_radius(rover), largest_wheel_shift(rover)
    low, high = np.reshape(terrain.bounds, (2, 2)).T
    doubtful = ((at - reach < low) | (at + reach > high)).any(axis=1)
    doubtful |= CellCounts(terrain, ~known).are_near(at, reach)
    chosen = np.flatnonzero(doubtful)
    groundless, unsure = np.zeros((2, HEADINGS, len(at)), bool)
    for heading, wheels in enumerate(wheel_places(rover) - terrain.origin):
        x, y = (at[chosen].T[:, None] + wheels.T[..., None]) / terrain.resolution
        unknown = ~_is_known(whole, x, y)
        unsure[heading, chosen] = unknown.any(axis=0)
        unknown[unknown] = _distance(away, x[unknown], y[unknown]) * terrain.resolution > shift
        groundless[heading, chosen] = unknown.any(axis=0)
    doubt = np.where(unsure.T.ravel(), np.float32(FULL_DOUBT), np.float32(0.0))
    return LatticeGround(groundless.T.ravel(), doubt)


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


def _distance(away: Floats, x: Floats, y: Floats) -> Floats:
    """Return bounds from below on the distances of places to known ground.

    All are in cells, as are the distances `away` of cell corners to the next known one.
    """
    rows, columns = away.shape
    i = np.clip((x + 0.5).astype(int), 0, columns - 1)
    j = np.clip((y + 0.5).astype(int), 0, rows - 1)
    beyond = np.hypot(x - i, y - j)
    return np.maximum(beyond, away[j, i] - beyond) - 1.0


def _is_known(whole: NDArray[np.bool_], x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Return whether places [cells] are on the map, in cells of which `whole` is True."""
    rows, columns = whole.shape
    on_map = (x >= -_ROUNDING) & (x <= columns + _ROUNDING)
    on_map &= (y >= -_ROUNDING) & (y <= rows + _ROUNDING)
    i = np.clip(x.astype(int), 0, columns - 1)
    j = np.clip(y.astype(int), 0, rows - 1)
    return on_map & whole.ravel()[j * columns + i]
