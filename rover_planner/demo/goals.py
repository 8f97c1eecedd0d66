# SPDX-License-Identifier: Apache-2.0
"""Chooses a start and goals on a map for demos: goals on plain ground and difficult goals."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.angles import wrap
from rover_planner.errors import PlanningError
from rover_planner.maps.cells import CellGrid, grid_of

Pose = tuple[float, float, float]

_PLAIN_GOALS = 4
"""Largest number of goals on plain ground; a small map has fewer."""
_STARTS = 200
"""Largest number of places that are tried as a start."""
_RAYS = 72
"""Directions in which the clear distance from a start is measured: every 5 degrees."""
_VIEWS = 721
"""Directions in which the known ground around the start is measured: every half degree."""
_HALF_CONE = np.deg2rad(50.0)
"""Half angle of the cone ahead of the start that holds the goals on plain ground [rad]."""
_WIDE_CONE = np.deg2rad(75.0)
"""Half angle of the cone ahead of the start that holds the goal off the map [rad]."""


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
    rng = np.random.default_rng(seed)
    ground = _survey(terrain, rover)
    start = _choose_start(ground, rng)
    found = [("plain", pose) for pose in _choose_plain(ground, start, _PLAIN_GOALS, rng)]
    for intent, score in _score_cells(ground, start):
        best = np.unravel_index(np.argmax(score), score.shape)
        if np.isfinite(score[best]):
            found.append((intent, _facing(start, *ground.grid.places(best[1], best[0]))))
    found.append(("off the map", _choose_off_map(ground, start)))
    goals = (Goal(chr(ord("A") + k), intent, pose) for k, (intent, pose) in enumerate(found))
    return Mission(start, tuple(goals))


def footprint_radius(rover: Rover) -> float:
    """Return the largest horizontal distance [m] of the wheels from the body origin."""
    wheel = rover.wheel
    return max(
        float(np.hypot(abs(x) + wheel.radius, abs(y) + 0.5 * wheel.width))
        for x, y, _ in rover.suspension.wheels.values()
    )


def _survey(terrain: Terrain, rover: Rover) -> _Ground:
    """Measure slopes and steps under a rover centred on each cell."""
    known = np.isfinite(terrain.elevation)
    # Unknown cells get the nearest known height, so that the rim of a gap is not a step.
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    z = terrain.elevation[tuple(nearest)]
    side = _odd_cells(2 * footprint_radius(rover), terrain.resolution)
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
    wheelbase = 2 * footprint_radius(rover)
    return _Ground(
        terrain,
        grid_of(terrain),
        np.where(whole, slope, np.nan),
        whole & (slope <= gentle_slope),
        np.where(whole, difficulty, np.nan),
        far=8 * wheelbase,
        near=1.5 * wheelbase,
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


def _choose_plain(ground: _Ground, start: Pose, count: int, rng) -> list[Pose]:
    """Choose goals in sight of the start, in directions spread over a cone ahead."""
    bearings = start[2] + np.linspace(-_HALF_CONE, _HALF_CONE, 4 * count + 1)
    sight = _sight(ground, ground.gentle, np.array([start]), bearings)[0]
    goals: list[Pose] = []
    for sector in np.array_split(np.arange(len(bearings)), count):
        ray = sector[np.argmax(sight[sector])]
        if sight[ray] < ground.near:
            continue
        distance = max(ground.near, rng.uniform(0.6, 0.9) * sight[ray])
        x = start[0] + distance * np.cos(bearings[ray])
        y = start[1] + distance * np.sin(bearings[ray])
        goal = _facing(start, *_gentlest_near(ground, x, y))
        away = [np.hypot(goal[0] - p[0], goal[1] - p[1]) for p in (start, *goals)]
        if away[0] > 0.75 * ground.near and min(away) > 0.5 * ground.near:
            goals.append(goal)
    return goals


def _gentlest_near(ground: _Ground, x: float, y: float) -> tuple[Any, Any]:
    """Return the place with the least difficulty around a point."""
    column, row = map(round, ground.grid.coordinates(x, y))
    around = max(1, round(0.06 * ground.far / ground.terrain.resolution))
    j, i = max(0, row - around), max(0, column - around)
    window = ground.difficulty[j : row + around + 1, i : column + around + 1]
    window = np.where(np.isfinite(window), window, np.inf)
    best = np.unravel_index(np.argmin(window), window.shape)
    return ground.grid.places(best[1] + i, best[0] + j)


def _score_cells(ground: _Ground, start: Pose) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the intents of hard goals and how well each cell (ny, nx) suits; -inf: it does not.

    Those ahead of the start are preferred: difficult places with known ground all the way, steep
    known ground, and near places that are well inside unknown ground.
    """
    ny, nx = ground.slope.shape
    x, y = ground.grid.places(np.arange(nx), np.arange(ny)[:, None])
    dx, dy = x - start[0], y - start[1]
    distance, bearing = np.hypot(dx, dy), np.arctan2(dy, dx)
    turn = np.abs(wrap(bearing - start[2]))
    ahead, known = 1 - turn / (2 * np.pi), np.isfinite(ground.slope)
    bearings = np.linspace(-np.pi, np.pi, _VIEWS)
    sight = _sight(ground, known, np.array([start]), bearings)[0]
    depth = ndimage.distance_transform_edt(np.pad(np.isnan(ground.terrain.elevation), 1))
    depth = depth[1:-1, 1:-1] * ground.terrain.resolution
    for intent, suits, score in (
        ("rough", known & (distance < np.interp(bearing, bearings, sight)), ground.difficulty),
        ("steep", known & (distance <= 1.2 * ground.far), ground.slope),
        ("unknown ground", depth > 0.1 * ground.near, None),
    ):
        value = -distance * (1 + 2 * turn) if score is None else score * ahead
        yield intent, np.where(suits & (distance >= ground.near), value, -np.inf)


def _choose_off_map(ground: _Ground, start: Pose) -> Pose:
    """Choose a point beyond the nearest edge of the map ahead."""
    bearings = start[2] + np.linspace(-_WIDE_CONE, _WIDE_CONE, 61)
    xmin, xmax, ymin, ymax = ground.terrain.bounds
    with np.errstate(divide="ignore"):
        along_x = np.where(np.cos(bearings) > 0, xmax - start[0], start[0] - xmin)
        along_y = np.where(np.sin(bearings) > 0, ymax - start[1], start[1] - ymin)
        edge = np.minimum(along_x / abs(np.cos(bearings)), along_y / abs(np.sin(bearings)))
    nearest = int(np.argmin(edge))
    distance = max(edge[nearest], 0.5 * ground.near) + 0.5 * ground.near
    x = start[0] + distance * np.cos(bearings[nearest])
    y = start[1] + distance * np.sin(bearings[nearest])
    return _facing(start, x, y)


def _facing(start: Pose, x: float, y: float) -> Pose:
    """Return a pose at x, y [m] with the end heading of a gentle curve from the start."""
    bearing = np.arctan2(y - start[1], x - start[0])
    turn = float(wrap(bearing - start[2]))
    return (float(x), float(y), float(bearing + (0.5 * turn if abs(turn) < _WIDE_CONE else 0.0)))


def _odd_cells(width: float, resolution: float) -> int:
    """Return the smallest odd number of cells that is not narrower than a width [m]."""
    return 2 * int(np.ceil(0.5 * width / resolution)) + 1
