"""Poses between waypoints, where wheels climb faces or roll off edges.

A wheel contact can jump from one waypoint to the next. The poses in between then decide whether
the rover gets there. The path is divided around each jump until the jump is resolved or the piece
is shorter than MIN_SPACING. A jump that remains is a change in height at one place. Upwards, the
wheel climbs a face: it is held at heights from foot to edge, with the face as its contact, and
evaluated at each. Downwards, the wheel drops.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.read_only import view_read_only
from rover_physics.prediction.evaluation import NONE_HELD, RESULT, new_results
from rover_physics.prediction.path_kernels import (
    JumpLimits,
    PathPoints,
    divide_stretches,
    find_jumps,
    sort_pieces,
)
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

HEIGHT_JUMP = 0.25
"""Change of a wheel's height between two poses [wheel radii] above which it is a jump."""
PIECES = 4
"""Number of pieces into which a stretch with a jump is divided in each round."""
MIN_SPACING = 1e-4
"""Distance between poses [m] below which a jump counts as at one place."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Fractions of a face's height at which a climbing wheel is evaluated. The foot (0) counts only if
the wheel already touches the edge of the face there: no later contact is as steep."""

Evaluate = Callable[[np.ndarray, np.ndarray], Any]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Poses between waypoints, in the order of the path."""

    place: np.ndarray
    """(m,) place along the path in waypoints: 2.5 is halfway between waypoints 2 and 3."""
    waypoint: np.ndarray
    """(m,) index of the waypoint that follows."""
    poses: np.ndarray
    """(m, 3) x, y [m], yaw [rad]."""
    results: Any
    """(m,) RESULT of each pose."""

    @property
    def points(self) -> PathPoints:
        """Read-only views of the data as a PathPoints tuple, for kernels."""
        parts = (self.place, self.waypoint, self.poses, self.results)
        return PathPoints(*map(view_read_only, parts))

    def select(self, rows: np.ndarray) -> "Crossings":
        """Return the poses at row indices, in that order, or where a mask (m,) is True."""
        results = _numbers(self.results)[rows].view(RESULT)[:, 0]
        return Crossings(self.place[rows], self.waypoint[rows], self.poses[rows], results)

    def between(self, first: int, end: int) -> "Crossings":
        """Return the poses from waypoint `first` up to `end`; places count from `first`."""
        rows = slice(*np.searchsorted(self.place, (first, end)))
        place, waypoint = self.place[rows] - first, self.waypoint[rows] - first
        return Crossings(place, waypoint, self.poses[rows], self.results[rows])

    def followed_by(self, more: "Crossings") -> "Crossings":
        """Return the rows of both, these first."""
        numbers = np.concatenate([_numbers(self.results), _numbers(more.results)])
        return Crossings(
            np.concatenate([self.place, more.place]),
            np.concatenate([self.waypoint, more.waypoint]),
            np.concatenate([self.poses, more.poses]),
            numbers.view(RESULT)[:, 0],
        )


_NUMBERS = RESULT.itemsize // 8


def _numbers(results: Any) -> np.ndarray:
    """Return RESULTs (n,) as floats (n, k), which numpy copies faster than records."""
    return results.view(np.float64).reshape(len(results), _NUMBERS)


def limits_of(radius: float) -> JumpLimits:
    """Return the JumpLimits for wheels of a radius [m]."""
    return JumpLimits(float(radius), MIN_SPACING, HEIGHT_JUMP * radius)


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
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints of one path, or of several paths
            one after the other, map frame.
        results: (n,) RESULT of each waypoint.
        evaluate: Function of poses (k, 3) and `held`: heights [m] and contact angles [rad] of
            held wheels, (k, 6, 2), or NONE_HELD. It returns RESULTs (k,).
        direction: 1 if the rover drives forwards along the path, -1 if backwards.
        joined: (n - 1,) True where a waypoint and the next one belong to the same path.

    Returns:
        The poses between the waypoints, without those of status NOT_SETTLED; poses of climbing
        wheels are kept in any case.
    """
    jumps = np.empty((len(poses), 2), np.int64)
    joined = np.broadcast_to(joined, len(poses) - 1)
    jumps = jumps[: find_jumps(results, poses, joined, limits_of(radius), jumps)]
    if not len(jumps):
        return _NOTHING
    rows = jumps.ravel()
    at_jumps = _numbers(results)[rows].view(RESULT)[:, 0]
    known = Crossings(rows.astype(float), jumps[:, 1].repeat(2), poses[rows], at_jumps)
    ends, climbed = np.arange(len(rows)).reshape(-1, 2), []
    while len(ends):
        known = known.followed_by(_divide(known, ends, evaluate))
        ends, closed = _sort_pieces(known, ends, radius)
        if len(closed):
            climbs = _climb(terrain, radius, known, closed, evaluate, direction)
            climbed.append(slice(len(known.place), len(known.place) + len(climbs.place)))
            known = known.followed_by(climbs)
    kept = known.results["status"] != PoseStatus.NOT_SETTLED
    kept[: len(rows)] = False
    for climb in climbed:
        kept[climb] = True
    between = np.flatnonzero(kept)
    return known.select(between[np.argsort(known.place[between], kind="stable")])


_NOTHING = Crossings(np.empty(0), np.empty(0, int), np.empty((0, 3)), new_results(0))


def _divide(known: Crossings, ends: np.ndarray, evaluate: Evaluate) -> Crossings:
    """Return PIECES - 1 evaluated poses in each stretch between the rows `ends` (k, 2)."""
    n = len(ends) * (PIECES - 1)
    place, waypoint, poses = np.empty(n), np.empty(n, np.int64), np.empty((n, 3))
    divide_stretches(ends, PIECES, known.points, (place, waypoint, poses))
    return Crossings(place, waypoint, poses, evaluate(poses, NONE_HELD))


def _sort_pieces(
    known: Crossings, ends: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces in which a contact still jumps, as rows (j, 2): open ones, closed ones.

    The last rows of `known` are the poses within the stretches `ends`. `sort_pieces` defines open
    and closed.
    """
    pieces = np.empty((2, len(ends) * PIECES, 2), np.int64)
    n_open, n_closed = sort_pieces(ends, PIECES, known.points, limits_of(radius), pieces)
    return pieces[0, :n_open], pieces[1, :n_closed]


def _climb(
    terrain: Terrain,
    radius: float,
    known: Crossings,
    ends: np.ndarray,
    evaluate: Evaluate,
    direction: float,
) -> Crossings:
    """Evaluate wheels that jump up at one place, held at stages between foot and edge.

    `ends` (k, 2) are the rows of `known` before and after each place.
    """
    before, after = known.results["wheel_centres"][ends].swapaxes(0, 1)
    rise = (after - before)[:, :, 2]
    climbing = rise > 0.05 * radius
    at = np.flatnonzero(np.any(climbing & (rise > HEIGHT_JUMP * radius), axis=1))
    if not len(at):
        return _NOTHING
    stages, foot = len(CLIMB_STAGES), ends[at, 0]
    held = np.full((len(at), stages, 6, 2), np.nan)
    for row, i in enumerate(at):
        course = known.poses[ends[i, 0], 2] + (0.0 if direction > 0.0 else np.pi)
        for wheel in np.flatnonzero(climbing[i]):
            centre = before[i, wheel]
            face, edge = _face_ahead(terrain, radius, centre, course)
            for k, height in enumerate(centre[2] + CLIMB_STAGES * rise[i, wheel]):
                if k > 0 or height > edge:
                    angle = direction * _angle_on_face(radius, height, face, edge)
                    held[row, k, wheel] = height, angle
    poses = np.repeat(known.poses[foot], stages, axis=0)
    results = evaluate(poses, held.reshape(-1, 6, 2))
    start, end = known.place[ends[at]].T[:, :, None]
    settled = (results["status"] == PoseStatus.SETTLED).reshape(-1, stages)
    climbs = Crossings(
        (start + CLIMB_STAGES * (end - start)).ravel(),
        np.repeat(known.waypoint[foot], stages),
        poses,
        results,
    )
    return climbs.select((settled | ~settled.any(axis=1, keepdims=True)).ravel())


def _face_ahead(terrain: Terrain, radius: float, centre: np.ndarray, yaw: float):
    """Return slope angle [rad] and edge height [m] of the ground ahead of a wheel centre (3,)."""
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
    """Return the contact angle [rad] of a wheel with its centre at `height` [m].

    The wheel touches the face while its centre is below the edge, then the edge.
    """
    above = (height - edge) / radius
    return face if above <= 0.0 else min(face, float(np.arccos(min(above, 1.0))))
