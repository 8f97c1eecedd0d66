# SPDX-License-Identifier: Apache-2.0
"""Chooses a start and goals on a map for demos: goals on plain ground and difficult goals."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError

Pose = tuple[float, float, float]

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

    def cells(self, x, y) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
        """Return row and column of points x, y [m], and a mask of those on the map."""
        ny, nx = self.slope.shape
        column = np.rint((np.asarray(x) - self.terrain.origin[0]) / self.terrain.resolution)
        row = np.rint((np.asarray(y) - self.terrain.origin[1]) / self.terrain.resolution)
        inside = (column >= 0) & (column < nx) & (row >= 0) & (row < ny)
        return (
            np.clip(row, 0, ny - 1).astype(int),
            np.clip(column, 0, nx - 1).astype(int),
            inside,
        )

    def place(self, row, column) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return x and y [m] of cells."""
        x = self.terrain.origin[0] + np.asarray(column) * self.terrain.resolution
        y = self.terrain.origin[1] + np.asarray(row) * self.terrain.resolution
        return x, y


class _View(NamedTuple):
    """Places of the cells (ny, nx) of a map as seen from the start."""

    distance: NDArray[np.float64]
    """Distance [m]."""
    bearing: NDArray[np.float64]
    """Direction [rad], map frame."""
    turn: NDArray[np.float64]
    """Angle off the start's heading [rad], to either side."""


def choose_mission(terrain: Terrain, rover: Rover, seed: int = 1, plain_goals: int = 4) -> Mission:
    """Choose a start and goals by the heights of a map; the model is not used.

    The start is on gentle known ground with much gentle ground ahead. Goals on plain ground are
    reached from it on a straight line over gentle ground, apart from rocks. The other goals are
    the roughest ground with known ground all the way to it, the steepest known ground, unknown
    ground if the map has any, and a point beyond the edge of the map.

    Args:
        terrain: The map, with or without unknown cells.
        rover: The rover; its size and wheels define gentle ground and the distance of goals.
        seed: Seed of the choice among equally good places.
        plain_goals: Largest number of goals on plain ground; a small map has fewer.

    Raises:
        PlanningError: The map has no place where all ground under the rover is known.
    """
    rng = np.random.default_rng(seed)
    ground = _survey(terrain, rover)
    start = _choose_start(ground, rng)
    found = [("plain", pose) for pose in _choose_plain(ground, start, plain_goals, rng)]
    view = _look_from(ground, start)
    for intent, score in (
        ("rough", _score_rough(ground, start, view)),
        ("steep", _score_steep(ground, view)),
        ("unknown ground", _score_unknown(ground, view)),
    ):
        pose = _choose_cell(ground, start, view, score)
        if pose is not None:
            found.append((intent, pose))
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
    x, y = ground.place(rows[chosen], columns[chosen])
    bearings = np.linspace(-np.pi, np.pi, _RAYS, endpoint=False)
    sight = _sight(ground, ground.gentle, x, y, bearings)
    cone = round(_HALF_CONE / (2 * np.pi / _RAYS))
    ahead = np.sum([np.roll(sight, k, axis=1) for k in range(-cone, cone + 1)], axis=0)
    best, ray = np.unravel_index(np.argmax(ahead), ahead.shape)
    return (float(x[best]), float(y[best]), float(bearings[ray]))


def _sight(ground: _Ground, clear: NDArray[np.bool_], x, y, bearings) -> NDArray[np.float64]:
    """Return the clear distance (n, m) [m] from points (n,) in directions (m,) [rad].

    `clear` is a mask (ny, nx) of the cells.
    """
    step = max(2 * ground.terrain.resolution, ground.far / 60)
    distances = np.arange(0.0, ground.far, step)
    px = x[:, None, None] + distances * np.cos(bearings)[:, None]
    py = y[:, None, None] + distances * np.sin(bearings)[:, None]
    row, column, inside = ground.cells(px, py)
    return step * np.cumprod(inside & clear[row, column], axis=2).sum(axis=2)


def _look_from(ground: _Ground, start: Pose) -> _View:
    """Return where the cells of a map are as seen from a start."""
    ny, nx = ground.slope.shape
    x, y = ground.place(np.arange(ny)[:, None], np.arange(nx)[None, :])
    bearing = np.arctan2(y - start[1], x - start[0])
    turn = np.abs(np.angle(np.exp(1j * (bearing - start[2]))))
    return _View(np.hypot(x - start[0], y - start[1]), bearing, turn)


def _choose_plain(ground: _Ground, start: Pose, count: int, rng) -> list[Pose]:
    """Choose goals in sight of the start, in directions spread over a cone ahead."""
    bearings = start[2] + np.linspace(-_HALF_CONE, _HALF_CONE, 4 * count + 1)
    sight = _sight(ground, ground.gentle, np.array([start[0]]), np.array([start[1]]), bearings)[0]
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


def _gentlest_near(ground: _Ground, x: float, y: float) -> tuple[float, float]:
    """Return the place with the least difficulty around a point."""
    row, column, _ = ground.cells(x, y)
    around = max(1, round(0.06 * ground.far / ground.terrain.resolution))
    j, i = max(0, int(row) - around), max(0, int(column) - around)
    window = ground.difficulty[j : int(row) + around + 1, i : int(column) + around + 1]
    window = np.where(np.isfinite(window), window, np.inf)
    best = np.unravel_index(np.argmin(window), window.shape)
    px, py = ground.place(best[0] + j, best[1] + i)
    return float(px), float(py)


def _score_rough(ground: _Ground, start: Pose, view: _View) -> NDArray[np.float64]:
    """Prefer difficult places with known ground all the way, ahead of the start."""
    bearings = np.linspace(-np.pi, np.pi, _VIEWS)
    known = np.isfinite(ground.slope)
    sight = _sight(ground, known, np.array([start[0]]), np.array([start[1]]), bearings)[0]
    in_view = known & (view.distance < np.interp(view.bearing, bearings, sight))
    return np.where(in_view, ground.difficulty * (1 - view.turn / (2 * np.pi)), -np.inf)


def _score_steep(ground: _Ground, view: _View) -> NDArray[np.float64]:
    """Prefer steep known ground ahead."""
    score = ground.slope * (1 - view.turn / (2 * np.pi))
    score = np.where(view.distance <= 1.2 * ground.far, score, -np.inf)
    return np.where(np.isfinite(score), score, -np.inf)


def _score_unknown(ground: _Ground, view: _View) -> NDArray[np.float64]:
    """Prefer near places ahead that are well inside unknown ground."""
    unknown = np.isnan(ground.terrain.elevation)
    depth = ndimage.distance_transform_edt(np.pad(unknown, 1))[1:-1, 1:-1]
    depth *= ground.terrain.resolution
    preferred = -view.distance * (1 + 2 * view.turn)
    return np.where(depth > 0.1 * ground.near, preferred, -np.inf)


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
    return _facing(start, float(x), float(y))


def _choose_cell(
    ground: _Ground, start: Pose, view: _View, score: NDArray[np.float64]
) -> Pose | None:
    """Return the cell with the highest score (ny, nx) beyond `near`, None if all are -inf."""
    allowed = np.where(view.distance >= ground.near, score, -np.inf)
    best = np.unravel_index(np.argmax(allowed), allowed.shape)
    if not np.isfinite(allowed[best]):
        return None
    x, y = ground.place(*best)
    return _facing(start, float(x), float(y))


def _facing(start: Pose, x: float, y: float) -> Pose:
    """Return a pose at x, y [m] with the end heading of a gentle curve from the start."""
    bearing = np.arctan2(y - start[1], x - start[0])
    turn = float(np.angle(np.exp(1j * (bearing - start[2]))))
    return (x, y, float(bearing + (0.5 * turn if abs(turn) < _WIDE_CONE else 0.0)))


def _odd_cells(width: float, resolution: float) -> int:
    """Return the smallest odd number of cells that is not narrower than a width [m]."""
    return 2 * int(np.ceil(0.5 * width / resolution)) + 1
