# SPDX-License-Identifier: Apache-2.0
"""Estimates from the map how likely the model refuses an edge, and finds nodes without ground.

The ground is taken as the wheels feel it: the surface on which the lowest points of spheres with
the wheel's radius move. An edge is the more likely refused, the steeper that surface is below all
six wheels together, and the steeper it is along the drive below one of them; unknown ground counts
as steep. The estimate orders the questions to the model and decides nothing.
"""

import math
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.rover.linkage import pack_linkage
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain
from rover_planner.angles import wrap
from rover_planner.planning.search.edges import Primitive
from rover_planner.planning.search.nodes import HEADINGS, YAWS, Nodes

SHARE = 0.25
"""Distance of the places that are looked at [cells of the lattice], at least one of the map."""
SAMPLE_SHARE = 0.5
"""Distance of the samples along an edge [cells of the lattice]."""
LEVEL, ALL_WHEELS, ONE_WHEEL = -4.6, 3.0, 1.1
"""Logit of a refusal: on level ground, and what is added for the mean steepness below the wheels
and for the largest one along the drive, both in shares of what the rover can climb. Fitted to the
verdicts on random edges of made and real maps, two rovers."""
UNKNOWN = 2.1
"""Slope of unknown ground along x and along y [slopes at which a climb ends]."""
STEPS_PER_UNIT = 30
"""Steps per unit in which difficulties are kept."""
LEAST_DIFFICULTY = 0.5 / STEPS_PER_UNIT
"""Difficulty of level ground."""
NOT_LOOKED = 255
"""Difficulty of a place that was not looked at."""
BETWEEN_CELLS = 1.5
"""Distance [cells] that a place on known ground may seem to be from known cells."""
_AHEAD = np.column_stack([np.cos(YAWS), np.sin(YAWS)])
"""(HEADINGS, 2) unit vectors along the headings."""


class Difficulty(NamedTuple):
    """The estimate for all edges of a window, as kernels read it; found where it is asked for."""

    slopes: np.ndarray
    """(2, ny, nx) float32 slopes of the ground as wheels feel it, along x and y, of the steepest
    cell around each place."""
    shifts: np.ndarray
    """(HEADINGS, 6, 2) int64 places in x and y from the body origin to the wheels."""
    climb: float
    """Slope at which a climb ends [rise over run]."""
    steps: np.ndarray
    """(HEADINGS, ny, nx) uint8 difficulty with the body origin at a place, in steps; at most 254
    of them, which is far beyond what any path takes; NOT_LOOKED until it is asked for."""
    first: np.ndarray
    """(2,) x and y of the first place, from the first place of the lattice [m]."""
    spacing: float
    """Distance of neighbouring places [m]."""
    cell: float
    """Distance of neighbouring nodes [m]."""
    samples: np.ndarray
    """(HEADINGS, P, S, 3) places along the primitives: x, y [m] from the first node, and heading;
    -1 as heading ends a list."""


def estimate_difficulty(
    rover: Rover,
    terrain: Terrain,
    nodes: Nodes,
    climb: float,
    primitives: tuple[tuple[Primitive, ...], ...],
) -> Difficulty:
    """Return the estimate.

    Args:
        rover: The rover.
        terrain: The ground.
        nodes: The nodes.
        climb: Slope at which a climb ends [rise over run].
        primitives: The primitives of each heading.
    """
    blocks = round(SHARE * nodes.cell / terrain.resolution)
    stride = max(1, min(blocks, *terrain.elevation.shape))
    felt = _felt_surface(terrain, rover.wheel.radius)
    slopes = np.array(np.gradient(felt, terrain.resolution)[::-1], np.float32)
    slopes[:, np.isnan(terrain.elevation)] = UNKNOWN * climb
    slopes = _find_steepest(slopes, stride)
    spacing = stride * terrain.resolution
    shifts = np.rint(wheel_places(rover) / spacing).astype(np.int64)
    first = np.asarray(terrain.origin) - nodes.cell * np.array(nodes.first)
    first += 0.5 * (stride - 1) * terrain.resolution
    return Difficulty(
        slopes,
        shifts,
        climb,
        np.full((HEADINGS, *slopes.shape[1:]), NOT_LOOKED, np.uint8),
        first,
        spacing,
        nodes.cell,
        sample_primitives(primitives, SAMPLE_SHARE * nodes.cell),
    )


def steepest_climb(rover: Rover, friction: float) -> float:
    """Return the slope [rise over run] at which friction, torque or tilt end a climb."""
    limits = rover.limits
    pull = 6.0 * rover.wheel.max_torque * limits.torque_saturation / rover.wheel.radius
    by_torque = math.tan(math.asin(min(pull / rover.weight, 0.99)))
    return min(friction * limits.friction_utilisation, by_torque, math.tan(limits.tilt))


def _felt_surface(terrain: Terrain, radius: float) -> NDArray[np.float32]:
    """Return (ny, nx) heights [m] of the lowest points of spheres that lie on the ground.

    Unknown cells have the height of the nearest known one.
    """
    elevation = np.asarray(terrain.elevation, np.float32)
    unknown = np.isnan(elevation)
    if unknown.any():
        nearest = ndimage.distance_transform_edt(
            unknown, return_distances=False, return_indices=True
        )
        elevation = elevation[tuple(nearest)]
    cells = int(radius / terrain.resolution)
    offset = terrain.resolution * np.arange(-cells, cells + 1)
    below = radius**2 - offset[:, None] ** 2 - offset**2
    shape = np.where(below >= 0.0, np.sqrt(np.maximum(below, 0.0)) - radius, 0.0)
    felt: NDArray[np.float32] = ndimage.grey_dilation(
        elevation, footprint=below >= 0.0, structure=shape, mode="nearest"
    )
    return felt


def _find_steepest(slopes: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """Return (2, ny, nx) slopes along x and y, the steepest of each `stride` x `stride` cells."""
    ny, nx = (size // stride for size in slopes.shape[1:])
    cut = slopes[:, : ny * stride, : nx * stride].reshape(2, ny, stride, nx, stride)
    blocks = cut.swapaxes(2, 3).reshape(2, ny, nx, -1)
    steepest = np.argmax(blocks[0] ** 2 + blocks[1] ** 2, axis=2)
    return np.take_along_axis(blocks, steepest[None, ..., None], axis=3)[..., 0]


@lru_cache(maxsize=8)
def sample_primitives(
    primitives: tuple[tuple[Primitive, ...], ...], spacing: float
) -> NDArray[np.float64]:
    """Return (HEADINGS, P, S, 3) places along the primitives, about `spacing` [m] apart.

    Each is x, y [m] from the first node, and the nearest heading; -1 as heading ends a list.
    """
    longest = max(one.length for own in primitives for one in own)
    most = 3 + int(longest / spacing)
    samples = np.full((HEADINGS, max(map(len, primitives)), most, 3), -1.0)
    for heading, own in enumerate(primitives):
        for k, one in enumerate(own):
            count = 2 + int(one.length / spacing)
            places = one.poses[np.rint(np.linspace(0, len(one.poses) - 1, count)).astype(int)]
            turned = np.abs(wrap(places[:, 2:] - YAWS))
            samples[heading, k, :count, :2] = places[:, :2]
            samples[heading, k, :count, 2] = np.argmin(turned, axis=1)
    return samples


@exact_kernel
def difficulty_of(difficulty, columns, node, k):
    """Return the difficulty of edge k of a node: -log of the probability that the model passes it.

    It is the largest at the samples of the edge.

    Args:
        difficulty: Difficulty; its `steps` are written.
        columns: Number of columns of places of the lattice.
        node: The node.
        k: Number of the edge.
    """
    heading, place = node % HEADINGS, node // HEADINGS
    x = (place % columns) * difficulty.cell - difficulty.first[0]
    y = (place // columns) * difficulty.cell - difficulty.first[1]
    _, ny, nx = difficulty.steps.shape
    largest = np.uint8(0)
    for sample in difficulty.samples[heading, k]:
        if sample[2] < 0.0:
            break
        i = min(max(int((x + sample[0]) / difficulty.spacing + 0.5), 0), nx - 1)
        j = min(max(int((y + sample[1]) / difficulty.spacing + 0.5), 0), ny - 1)
        steps = difficulty.steps[int(sample[2])]
        if steps[j, i] == NOT_LOOKED:
            steps[j, i] = _look_at(difficulty, int(sample[2]), j, i)
        largest = max(largest, steps[j, i])
    return (largest + 0.5) / STEPS_PER_UNIT


@exact_kernel
def _look_at(difficulty, heading, j, i):
    """Return the difficulty in steps with the body origin at place j, i, with a heading."""
    _, ny, nx = difficulty.slopes.shape
    steepness, most = 0.0, 0.0
    for wheel in range(6):
        column = min(max(i + difficulty.shifts[heading, wheel, 0], 0), nx - 1)
        row = min(max(j + difficulty.shifts[heading, wheel, 1], 0), ny - 1)
        x, y = difficulty.slopes[0, row, column], difficulty.slopes[1, row, column]
        steepness += math.sqrt(x * x + y * y)
        most = max(most, abs(_AHEAD[heading, 0] * x + _AHEAD[heading, 1] * y))
    logit = LEVEL + (ALL_WHEELS * steepness / 6.0 + ONE_WHEEL * most) / difficulty.climb
    return np.uint8(min(STEPS_PER_UNIT * math.log1p(math.exp(min(logit, 8.0))), 254.0))


def find_groundless(rover: Rover, terrain: Terrain, nodes: Nodes) -> NDArray[np.bool_]:
    """Return (nodes,) whether a wheel is over unknown ground however the rover tilts.

    The model refuses these, and some more.

    Args:
        rover: The rover.
        terrain: The ground.
        nodes: The nodes.
    """
    groundless = np.zeros((nodes.count // HEADINGS, HEADINGS), bool)
    unknown = np.isnan(terrain.elevation)
    if not unknown.any():
        return groundless.ravel()
    away, last = ndimage.distance_transform_edt(unknown), np.array(unknown.shape[::-1]) - 1

    def from_known(places: Floats) -> Floats:
        """Return bounds (n,) from below on the distances of places to known cells, in cells."""
        column, row = np.clip(np.rint(places), 0, last).astype(int).T
        return np.asarray(away[row, column])

    at = nodes.poses(np.arange(0, nodes.count, HEADINGS))[:, :2]
    at = (at - terrain.origin) / terrain.resolution
    shift = largest_wheel_shift(rover) / terrain.resolution + BETWEEN_CELLS
    reach = swing_radius(rover) / terrain.resolution + BETWEEN_CELLS
    far = np.flatnonzero(from_known(at) > shift - reach)
    for heading, wheels in enumerate(wheel_places(rover) / terrain.resolution):
        for wheel in wheels:
            groundless[far, heading] |= from_known(at[far] + wheel) > shift
    return groundless.ravel()


def wheel_places(rover: Rover) -> NDArray[np.float64]:
    """Return (HEADINGS, 6, 2) x, y [m] of the wheel centres at a node at the origin, level."""
    places = pack_linkage(rover).wheels
    c, s = np.cos(YAWS)[:, None], np.sin(YAWS)[:, None]
    x, y = c * places[:, 0] - s * places[:, 1], s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y], axis=-1)


def largest_wheel_shift(rover: Rover) -> float:
    """Return how far a wheel centre is at most from its place on level ground [m].

    Each link turns by no more than the limits of body, rocker and bogie together.
    """
    suspension = rover.suspension
    rocking, turning = (
        max(map(abs, limits)) for limits in (suspension.rocker_limits, suspension.bogie_limits)
    )
    angles = np.minimum(np.cumsum([rover.limits.tilt, rocking, turning]), math.pi)
    farthest = 0.0
    for name, wheel in suspension.wheels.items():
        joints = [(0.0, 0.0, 0.0), suspension.rocker_pivot, wheel]
        if name in suspension.bogie_wheels:
            joints.insert(2, suspension.bogie_pivot)
        links = (math.dist(*ends) for ends in pairwise(joints))
        chords = (2.0 * k * math.sin(0.5 * a) for k, a in zip(links, angles, strict=False))
        farthest = max(farthest, sum(chords))
    return farthest
