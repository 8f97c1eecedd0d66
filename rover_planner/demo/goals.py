# SPDX-License-Identifier: Apache-2.0
"""Chooses a start and goals on a map for demos: goals on plain ground and difficult goals."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain
from rover_planner.angles import wrap
from rover_planner.errors import PlanningError
from rover_planner.maps.cells import CellGrid, grid_of

Pose = tuple[float, float, float]

_SECTORS = 4
"""Sectors ahead of the start with a goal on plain ground in each; a small map has fewer."""
_PLAIN = (0.6, 0.9)
"""Shares of the way over gentle ground at which such a goal may be."""
_STARTS = 200
"""Largest number of places that are tried as a start."""
_RAYS = 72
"""Directions in which the clear distance from a start is measured: every 5 degrees."""
_VIEWS = 721
"""Directions in which the ground around the start is measured: every half degree."""
_HALF_CONE = np.deg2rad(50.0)
"""Half angle of the cone ahead of the start that holds the goals on plain ground [rad]."""
_WIDE_CONE = np.deg2rad(75.0)
"""Largest turn of a goal from the start's heading that its own heading goes along with [rad]."""


@dataclass(frozen=True)
class Goal:
    """A goal of a mission."""

    name: str
    """Letter that names it in tables and pictures."""
    intent: str
    """Kind of goal: "plain", "rough", "steep", "unknown ground" or "off the map"."""
    pose: Pose
    """x, y [m] and yaw [rad] of the body origin, map frame."""


@dataclass(frozen=True)
class Mission:
    """The start of a rover and its goals."""

    start: Pose
    """x, y [m] and yaw [rad] of the body origin, map frame."""
    goals: tuple[Goal, ...]
    """The goals, those on plain ground first."""


@dataclass(frozen=True)
class _Ground:
    """Properties of a map for a rover: one value per cell, for a rover centred there."""

    terrain: Terrain
    grid: CellGrid
    slope: NDArray[np.float64]
    """Mean slope under the rover (ny, nx) [rise over run]; NaN if the footprint is not known."""
    gentle: NDArray[np.bool_]
    """Mask (ny, nx): the footprint is known and its slope is at most half of the tilt limit."""
    difficulty: NDArray[np.float64]
    """Slopes and steps (ny, nx) relative to the rover's capability; NaN as in `slope`."""
    far: float
    """Largest distance of a goal from the start [m]."""
    near: float
    """Smallest distance of a goal from the start [m]."""


def choose_mission(terrain: Terrain, rover: Rover, seed: int = 1) -> Mission:
    """Choose a start and goals by the heights of a map; the model is not used.

    The start is on gentle known ground with much gentle ground ahead. Goals on plain ground are
    reached from it on a straight line over gentle ground, apart from rocks. The other goals are
    the roughest ground with known ground all the way to it, the steepest known ground, unknown
    ground if the map has any, and a point beyond the edge of the map.

    Args:
        terrain: The map, with or without unknown cells.
        rover: The rover; its size and wheels define gentle ground and the distance of goals.
        seed: Seed of the choice among equally good places.

    Raises:
        PlanningError: The map has no place where all ground under the rover is known.
    """
    ground = _survey(terrain, rover)
    start = _choose_start(ground, np.random.default_rng(seed))
    found = []
    for intent, score in _score_cells(ground, start):
        row, column = np.unravel_index(np.argmax(score), score.shape)
        if np.isfinite(score[row, column]):
            found.append((intent, ground.grid.places(column, row)))
    found.append(("off the map", _choose_off_map(ground, start)))
    goals = (
        Goal(chr(ord("A") + k), intent, _facing(start, *place))
        for k, (intent, place) in enumerate(found)
    )
    return Mission(start, tuple(goals))


def _survey(terrain: Terrain, rover: Rover) -> _Ground:
    """Measure slopes and steps under a rover centred on each cell."""
    known, reach = np.isfinite(terrain.elevation), swing_radius(rover) + rover.wheel.radius
    # Unknown cells get the nearest known height, so that the rim of a gap is not a step.
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    z = terrain.elevation[tuple(nearest)]
    side = _odd_cells(2 * reach, terrain.resolution)
    whole = ndimage.minimum_filter(known, side, mode="constant", cval=False)
    if not whole.any():
        raise PlanningError(
            f"the map has no place where all ground under {rover.name} is known, "
            f"{side * terrain.resolution:.2f} m square; it is too small or has too many gaps"
        )
    gy, gx = np.gradient(z, terrain.resolution)
    slope = np.hypot(ndimage.uniform_filter(gx, side), ndimage.uniform_filter(gy, side))
    wheel = _odd_cells(2 * rover.wheel.radius, terrain.resolution)
    step = ndimage.maximum_filter(z, wheel) - ndimage.minimum_filter(z, wheel)
    rise = step - slope * wheel * terrain.resolution
    worst = ndimage.maximum_filter(rise, side)
    gentle_slope = 0.5 * np.tan(rover.limits.tilt)
    difficulty = np.maximum(slope / gentle_slope, worst / rover.wheel.radius)
    return _Ground(
        terrain,
        grid_of(terrain),
        np.where(whole, slope, np.nan),
        whole & (slope <= gentle_slope),
        np.where(whole, difficulty, np.nan),
        far=16 * reach,
        near=3 * reach,
    )


def _choose_start(ground: _Ground, rng: np.random.Generator) -> Pose:
    """Choose the position and heading on gentle ground with the most gentle ground ahead."""
    rows, columns = np.nonzero(np.isfinite(ground.difficulty))
    share = ground.difficulty[rows, columns]
    gentle = share <= max(0.5, np.quantile(share, 0.1))
    chosen = rng.permutation(np.nonzero(gentle)[0])[:_STARTS]
    x, y = ground.grid.places(columns[chosen], rows[chosen])
    bearings = np.linspace(-np.pi, np.pi, _RAYS, endpoint=False)
    sight = _sight(ground, ground.gentle, np.column_stack([x, y]), bearings)
    cone = round(_HALF_CONE / (2 * np.pi / _RAYS))
    ahead = np.sum([np.roll(sight, k, axis=1) for k in range(-cone, cone + 1)], axis=0)
    best, ray = np.unravel_index(np.argmax(ahead), ahead.shape)
    return (float(x[best]), float(y[best]), float(bearings[ray]))


def _sight(ground: _Ground, clear: NDArray[np.bool_], places, bearings) -> NDArray[np.float64]:
    """Return the clear distance (n, m) [m] from places (n, 2) or poses (n, 3), x, y [m].

    It is that in directions (m,) [rad]; `clear` is a mask (ny, nx) of the cells.
    """
    step = max(2 * ground.terrain.resolution, ground.far / 60)
    distances = np.arange(0.0, ground.far, step)
    px = places[:, 0, None, None] + distances * np.cos(bearings)[:, None]
    py = places[:, 1, None, None] + distances * np.sin(bearings)[:, None]
    column, row = ground.grid.coordinates(px, py)
    seen = ndimage.map_coordinates(clear, [row, column], order=0, mode="grid-constant")
    return np.asarray(step * np.cumprod(seen, axis=2).sum(axis=2), float)


def _score_cells(ground: _Ground, start: Pose) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the intents of goals on the map and how well each cell (ny, nx) suits; -inf: not.

    They are plain ones, far ahead over gentle ground, and hard ones, preferably ahead: difficult
    places with known ground all the way, steep known ground, and near places that are well inside
    unknown ground.
    """
    ny, nx = ground.slope.shape
    x, y = ground.grid.places(np.arange(nx), np.arange(ny)[:, None])
    distance, turn = _measure_way(start, x, y)
    bearings = start[2] + np.linspace(-np.pi, np.pi, _VIEWS)
    known = np.isfinite(ground.slope)
    gentle_way, known_way = (
        np.interp(start[2] + turn, bearings, _sight(ground, clear, np.array([start]), bearings)[0])
        for clear in (ground.gentle, known)
    )
    ahead = 1 - np.abs(turn) / (2 * np.pi)
    depth = ndimage.distance_transform_edt(np.pad(np.isnan(ground.terrain.elevation), 1))
    depth = depth[1:-1, 1:-1] * ground.terrain.resolution
    low, high = _PLAIN
    plain = ground.gentle & (distance >= low * gentle_way) & (distance <= high * gentle_way)
    across = _SECTORS * (0.5 + 0.5 * turn / _HALF_CONE)  # in sectors, from the right
    easy = distance * (1 - np.abs(across % 1 - 0.5)) - 3 * ground.near * ground.difficulty
    for intent, suits, score in (
        *(("plain", plain & (np.floor(across) == k), easy) for k in range(_SECTORS)),
        ("rough", known & (distance < known_way), ground.difficulty * ahead),
        ("steep", known & (distance <= 1.2 * ground.far), ground.slope * ahead),
        ("unknown ground", depth > 0.1 * ground.near, -distance * (1 + 2 * np.abs(turn))),
    ):
        yield intent, np.where(suits & (distance >= ground.near), score, -np.inf)


def _measure_way(start: Pose, x: Any, y: Any) -> tuple[Any, Any]:
    """Return the distance [m] to places from a start, and the turn to them [rad]."""
    dx, dy = x - start[0], y - start[1]
    return np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - start[2])


def _choose_off_map(ground: _Ground, start: Pose) -> tuple[float, float]:
    """Choose a point beyond the nearest edge of the map ahead."""
    left, right, low, high = ground.terrain.bounds
    bearings = start[2] + np.linspace(-_WIDE_CONE, _WIDE_CONE, 61)
    ahead, here = np.stack([np.cos(bearings), np.sin(bearings)], axis=1), np.array(start[:2])
    with np.errstate(divide="ignore"):
        room = np.abs((np.where(ahead > 0, (right, high), (left, low)) - here) / ahead)
    edge = room.min(axis=1)
    k = np.argmin(edge)
    x, y = here + (max(edge[k], 0.5 * ground.near) + 0.5 * ground.near) * ahead[k]
    return x, y


def _facing(start: Pose, x: float, y: float) -> Pose:
    """Return a pose at x, y [m] with the end heading of a gentle curve from the start."""
    turn = float(_measure_way(start, x, y)[1])
    heading = start[2] + (1.5 * turn if abs(turn) < _WIDE_CONE else turn)
    return (float(x), float(y), heading)


def _odd_cells(width: float, resolution: float) -> int:
    """Return the smallest odd number of cells that is not narrower than a width [m]."""
    return 2 * int(np.ceil(0.5 * width / resolution)) + 1
