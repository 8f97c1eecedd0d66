"""Between waypoints: faces that wheels climb, edges they roll off, and how far they drop.

Where the contact of a wheel jumps from one waypoint to the next, the poses in between decide
whether the rover gets there. The path is halved around each jump until the jump is resolved or
shorter than SHORTEST. What is left is a jump in height at one place: upwards the wheel is
evaluated while it climbs the face, held at heights from foot to edge with the face as its
contact; downwards it drops.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rover_physics.evaluation import NONE_HELD, RESULT, new_results
from rover_physics.path_kernels import divide_stretches, find_jumps
from rover_physics.settling import NOT_SETTLED, SETTLED
from rover_physics.terrain import Terrain

HEIGHT_JUMP = 0.25
"""Change of a wheel's height, in wheel radii, that is looked into."""
PIECES = 4
"""Pieces into which a stretch with a jump is divided, again and again."""
SHORTEST = 1e-4
"""Distance between poses [m] below which a jump counts as one place."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Shares of the height of a face at which a climbing wheel is evaluated; at its foot only where
the wheel has the edge of the face there, for no later contact is as steep."""

Evaluate = Callable[[np.ndarray, np.ndarray], Any]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Poses between waypoints, in the order of the path."""

    place: np.ndarray
    """(m,) place along the path, counted in waypoints."""
    waypoint: np.ndarray
    """(m,) index of the waypoint that follows."""
    poses: np.ndarray
    """(m, 3) x, y [m], yaw [rad]."""
    results: Any
    """(m,) RESULT of each pose."""

    def select(self, rows: np.ndarray | slice) -> "Crossings":
        """Return the poses that a mask (m,) has, or those of some rows in their order."""
        return Crossings(
            self.place[rows], self.waypoint[rows], self.poses[rows], _take(self.results, rows)
        )

    def between(self, first: int, end: int) -> "Crossings":
        """Return what lies between waypoints `first` and `end`, counted from the first of them."""
        start, stop = np.searchsorted(self.place, (first, end))
        part = self.select(slice(start, stop))
        return replace(part, place=part.place - first, waypoint=part.waypoint - first)


def find_crossings(
    terrain: Terrain,
    radius: float,
    poses: np.ndarray,
    results: Any,
    evaluate: Evaluate,
    direction: float = 1.0,
    joined: np.ndarray | bool = True,
) -> Crossings:
    """Evaluate the poses between waypoints where contacts jump.

    Args:
        terrain: The ground.
        radius: Wheel radius [m].
        poses: (n, 3) waypoints of one path, or of several behind one another.
        results: (n,) their RESULTs.
        evaluate: Evaluates poses (k, 3), with heights and contact angles (k, 6, 2) of held
            wheels or NONE_HELD.
        direction: 1 where the rover drives forwards along the path, -1 backwards.
        joined: (n - 1,) True where the path leads from a waypoint to the next one.
    """
    ends = _find_jumps(results, len(poses), radius)
    before, after = ends.T
    spacing = np.hypot(*(poses[after] - poses[before])[:, :2].T)
    near = (after - before == 1) & (spacing <= radius) & (spacing > 0.0)
    ends = ends[near & np.broadcast_to(joined, len(poses) - 1)[before]]
    open_ = _Stretches(ends.astype(float), poses[ends], _take(results, ends))
    found = []
    while len(open_.place):
        whole, inner = open_.divide(evaluate)
        found.append(inner.select(inner.results["status"] != NOT_SETTLED))
        pieces, stuck = whole.split(radius)
        short = np.hypot(*(pieces.poses[:, 1] - pieces.poses[:, 0])[:, :2].T) < SHORTEST
        closed = short | stuck
        if closed.any():
            found.append(_climb(terrain, radius, pieces.select(closed), evaluate, direction))
            pieces = pieces.select(~closed)
        open_ = pieces
    return _in_order(found)


_NOTHING = Crossings(np.empty(0), np.empty(0, int), np.empty((0, 3)), new_results(0))


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Stretches of the path within which a contact jumps: p poses of each, ends included."""

    place: np.ndarray
    """(k, p) places, counted in waypoints."""
    poses: np.ndarray
    """(k, p, 3) the poses there."""
    results: Any
    """(k, p) the RESULTs there."""

    def waypoint(self) -> np.ndarray:
        """Return (k,) the index of the waypoint that follows."""
        return self.place[:, 0].astype(int) + 1

    def select(self, mask: np.ndarray) -> "_Stretches":
        """Return the stretches where `mask` (k,) is True."""
        return _Stretches(self.place[mask], self.poses[mask], _take(self.results, mask))

    def divide(self, evaluate: Evaluate) -> tuple["_Stretches", Crossings]:
        """Return the stretches with PIECES - 1 poses more between the two of each, and those."""
        k, p = len(self.place), PIECES + 1
        place, poses = np.empty((k, p)), np.empty((k, p, 3))
        place[:, ::PIECES], poses[:, ::PIECES] = self.place, self.poses
        divide_stretches(place, poses)
        inner = Crossings(
            place[:, 1:-1].ravel(),
            self.waypoint().repeat(p - 2),
            poses[:, 1:-1].reshape(-1, 3),
            evaluate(poses[:, 1:-1].reshape(-1, 3), NONE_HELD),
        )
        numbers = np.empty((k, p, _NUMBERS))
        numbers[:, ::PIECES] = _numbers(self.results)
        numbers[:, 1:-1] = _numbers(inner.results).reshape(k, p - 2, -1)
        return _Stretches(place, poses, numbers.view(RESULT)[..., 0]), inner

    def split(self, radius: float) -> tuple["_Stretches", np.ndarray]:
        """Return the pieces within which a contact still jumps, and which of them are stuck.

        Stuck (k,) are those that hold a pose in which the rover does not settle.
        """
        results = self.results.reshape(-1)
        ends = _find_jumps(results, self.place.shape[1], radius)
        place, poses = self.place.reshape(-1), self.poses.reshape(-1, 3)
        pieces = _Stretches(place[ends], poses[ends], _take(results, ends))
        return pieces, ends[:, 1] - ends[:, 0] > 1


def _find_jumps(results: Any, run: int, radius: float) -> np.ndarray:
    """Return the rows (j, 2) of neighbours between which a contact jumps; see `find_jumps`."""
    ends = np.empty((len(results), 2), np.int64)
    return ends[: find_jumps(results, run, HEIGHT_JUMP * radius, ends)]


_NUMBERS = RESULT.itemsize // 8


def _numbers(results: Any) -> np.ndarray:
    """Return RESULTs (...) as numbers (..., k): to copy these is much faster."""
    return results.view(np.float64).reshape(*results.shape, _NUMBERS)


def _take(results: Any, rows: np.ndarray | slice) -> Any:
    """Return `results[rows]`."""
    return _numbers(results)[rows].view(RESULT)[..., 0]


def _in_order(found: list[Crossings]) -> Crossings:
    found = [part for part in found if len(part.place)]
    if not found:
        return _NOTHING
    place = np.concatenate([part.place for part in found])
    together = Crossings(
        place,
        np.concatenate([part.waypoint for part in found]),
        np.concatenate([part.poses for part in found]),
        np.concatenate([_numbers(part.results) for part in found]).view(RESULT)[:, 0],
    )
    return together.select(np.argsort(place, kind="stable"))


def _climb(
    terrain: Terrain, radius: float, places: _Stretches, evaluate: Evaluate, direction: float
) -> Crossings:
    """Evaluate wheels held at stages between foot and edge where they jump up at one place."""
    before, after = places.results[:, 0]["wheel_centres"], places.results[:, 1]["wheel_centres"]
    rise = (after - before)[:, :, 2]
    climbing = rise > 0.05 * radius
    at = np.flatnonzero(np.any(climbing & (rise > HEIGHT_JUMP * radius), axis=1))
    if not len(at):
        return _NOTHING
    stages, waypoint = len(CLIMB_STAGES), places.waypoint()
    held = np.full((len(at), stages, 6, 2), np.nan)
    for row, i in enumerate(at):
        course = places.poses[i, 0, 2] + (0.0 if direction > 0.0 else np.pi)
        for wheel in np.flatnonzero(climbing[i]):
            centre = before[i, wheel]
            face, edge = _face_ahead(terrain, radius, centre, course)
            for k, height in enumerate(centre[2] + CLIMB_STAGES * rise[i, wheel]):
                if k > 0 or height > edge:
                    angle = direction * _angle_on_face(radius, height, face, edge)
                    held[row, k, wheel] = height, angle
    poses = np.repeat(places.poses[at, 0], stages, axis=0)
    results = evaluate(poses, held.reshape(-1, 6, 2))
    start, end = places.place[at, :1], places.place[at, 1:]
    settled = (results["status"] == SETTLED).reshape(-1, stages)
    climbs = Crossings(
        (start + CLIMB_STAGES * (end - start)).ravel(),
        np.repeat(waypoint[at], stages),
        poses,
        results,
    )
    return climbs.select((settled | ~settled.any(axis=1, keepdims=True)).ravel())


def _face_ahead(terrain: Terrain, radius: float, centre: np.ndarray, yaw: float):
    """Return slope angle [rad] and edge height [m] of the ground just ahead of a wheel."""
    step = 0.25 * terrain.resolution
    ahead = np.arange(0.0, radius + 2.0 * terrain.resolution, step)
    heights = terrain.elevation_at(
        centre[0] + ahead * np.cos(yaw), centre[1] + ahead * np.sin(yaw)
    )
    slopes = np.diff(heights) / step
    if not np.isfinite(slopes).any():
        return 0.5 * np.pi, np.inf
    return float(np.arctan(np.nanmax(slopes))), float(np.nanmax(heights))


def _angle_on_face(radius: float, height: float, face: float, edge: float) -> float:
    """Return the contact angle of a wheel with its centre at `height`: on the face or its edge."""
    above = (height - edge) / radius
    return face if above <= 0.0 else min(face, float(np.arccos(min(above, 1.0))))
