# SPDX-License-Identifier: Apache-2.0
"""Poses between waypoints, where wheels climb faces, roll off edges, or sweep round in a turn.

A wheel contact can jump from one waypoint to the next. The poses in between then decide whether
the rover gets there. The path is divided around each jump until the jump is resolved or the piece
is shorter than MIN_SPACING. A jump that remains is a change in height at one place. Upwards, the
wheel climbs a face: it is held at heights from foot to edge, with the face as its contact, and
evaluated at each. Downwards, the wheel drops.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rover_physics.numerics.read_only import view_read_only
from rover_physics.prediction.evaluation import NONE_HELD
from rover_physics.prediction.path_kernels import (
    JumpLimits,
    PathPoints,
    Wheels,
    divide_stretches,
    find_jumps,
    find_turned_wheels,
    find_turns,
    sort_pieces,
)
from rover_physics.results.record import (
    join_results,
    new_results,
    numbers_of,
    place_results,
    select_results,
    unwritten_results,
)
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

HEIGHT_JUMP = 0.25
"""Change of a wheel's height between two poses [wheel radii] above which it is a jump."""
PIECES = 4
"""Number of pieces into which a stretch with a jump is divided in each round."""
MIN_SPACING = 1e-4
"""Distance between poses [m] below which a jump counts as at one place."""
PEAK_SPACING, FALL_SPACING = 0.01, 0.02
"""Distances [wheel radii] below which peaks of forces at a limit are not searched, and smaller
peaks and ends of falls. With 0.06 for smaller peaks, twice as many waypoints change 5 verdicts in
1,000, not 2, and rough ground costs less than 1 % less."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Fractions of a face's height at which a climbing wheel is evaluated. The foot (0) counts only if
the wheel already touches the edge of the face there: no later contact is as steep."""

Evaluate = Callable[..., Any]
"""Function of poses (k, 3), `held` (default NONE_HELD) and `motions` (default AHEAD) that returns
RESULTs (k,)."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Poses between waypoints, in the order of the path."""

    place: np.ndarray
    """(m,) place along the path in waypoints: 2.5 is halfway between waypoints 2 and 3."""
    waypoint: np.ndarray
    """(m,) index of the waypoint that follows."""
    climbing: np.ndarray
    """(m,) True where a wheel is held at a face."""
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
        return Crossings(
            self.place[rows],
            self.waypoint[rows],
            self.climbing[rows],
            self.poses[rows],
            select_results(self.results, rows),
        )

    def in_order(self) -> "Crossings":
        """Return the poses in path order; at a waypoint, the stretch that ends there is first."""
        return self.select(np.lexsort((self.waypoint, self.place)))

    def between(self, first: int, end: int) -> "Crossings":
        """Return the poses from waypoint `first` up to `end`; places count from `first`."""
        rows = slice(*np.searchsorted(self.place, (first, end)))
        return Crossings(
            self.place[rows] - first,
            self.waypoint[rows] - first,
            self.climbing[rows],
            self.poses[rows],
            self.results[rows],
        )

    def moved(self, waypoints: int) -> "Crossings":
        """Return the poses as they lie behind that many further waypoints."""
        return replace(self, place=self.place + waypoints, waypoint=self.waypoint + waypoints)

    def reversed(self, waypoints: int) -> "Crossings":
        """Return the poses as they lie on the reversed path of that many waypoints."""
        rows = np.arange(len(self.place))[::-1]
        flipped = self.select(rows)
        return replace(
            flipped,
            place=(waypoints - 1) - flipped.place,
            waypoint=waypoints - flipped.waypoint,
        )


def join_crossings(parts: Sequence[Crossings]) -> Crossings:
    """Return the rows of all parts, one after the other."""
    if not parts:
        return _NOTHING
    if len(parts) == 1:
        return parts[0]
    return Crossings(
        np.concatenate([part.place for part in parts]),
        np.concatenate([part.waypoint for part in parts]),
        np.concatenate([part.climbing for part in parts]),
        np.concatenate([part.poses for part in parts]),
        join_results([part.results for part in parts]),
    )


class _Known:
    """Evaluated poses of the searched stretches, in arrays with room for more."""

    def __init__(self, first: Crossings) -> None:
        self.count = 0
        self._make_room(first, 8 * len(first.place))
        self.add(first)

    @property
    def rows(self) -> Crossings:
        """The poses so far, as views."""
        parts = (self._place, self._waypoint, self._climbing, self._poses, self._results)
        return Crossings(*(part[: self.count] for part in parts))

    def add(self, more: Crossings) -> None:
        """Append poses."""
        end = self.count + len(more.place)
        if end > len(self._place):
            self._make_room(self.rows, 2 * end)
        rows = slice(self.count, end)
        self._place[rows], self._waypoint[rows] = more.place, more.waypoint
        self._climbing[rows], self._poses[rows] = more.climbing, more.poses
        numbers_of(self._results)[rows] = numbers_of(more.results)
        self.count = end

    def _make_room(self, known: Crossings, size: int) -> None:
        """Move the poses so far into arrays of `size` rows."""
        self._place, self._waypoint = np.empty(size), np.empty(size, np.int64)
        self._climbing, self._poses = np.empty(size, bool), np.empty((size, 3))
        self._results = unwritten_results(size)
        count, self.count = self.count, 0
        if count:
            self.add(known)


def limits_of(wheels: Wheels) -> JumpLimits:
    """Return the JumpLimits of a rover."""
    radius = wheels.radius
    return JumpLimits(
        max_spacing=radius,
        min_spacing=MIN_SPACING,
        height=HEIGHT_JUMP * radius,
        reach=wheels.reach,
        on_servos=wheels.on_servos,
        friction=wheels.friction_limit,
        torque=wheels.torque_limit,
        peak_spacing=PEAK_SPACING * radius,
        fall_spacing=FALL_SPACING * radius,
    )


def find_crossings(
    terrain: Terrain,
    wheels: Wheels,
    poses: np.ndarray,
    results: Any,
    evaluate: Evaluate,
    joined: np.ndarray | bool = True,
) -> Crossings:
    """Evaluate the poses between waypoints: at jumps, near limits, and where something turns far.

    Args:
        terrain: The ground.
        wheels: Size of wheels and rover.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints of one path, or of several paths
            one after the other, map frame.
        results: (n,) RESULT of each waypoint.
        evaluate: Function of poses (k, 3), `held`, heights [m] and contact angles [rad] of held
            wheels, (k, 6, 2), or NONE_HELD, and `motions` (k, 3). It returns RESULTs (k,).
        joined: (n - 1,) True where a waypoint and the next one belong to the same path.

    Returns:
        The poses between the waypoints, without those of status NOT_SETTLED; poses of climbing
        wheels and those that divide a long turn are kept in any case.
    """
    joined = np.broadcast_to(joined, len(poses) - 1)
    at_rest = turn_wheels(poses, results, joined, evaluate)
    limits = limits_of(wheels)
    jumps = _find_jumps(poses, results, joined, limits)
    turns, inside, jumps_in_turns = _divide_turns(poses, results, joined, limits, evaluate)
    if not len(jumps) and not len(inside):
        return at_rest
    rows = jumps.ravel()
    no_climb, at_jumps = np.zeros(len(rows), bool), select_results(results, rows)
    path = Crossings(rows.astype(float), jumps[:, 1].repeat(2), no_climb, poses[rows], at_jumps)
    known = _Known(join_crossings([path, turns]))
    ends = np.vstack([np.arange(len(rows)).reshape(-1, 2), len(rows) + jumps_in_turns])
    while len(ends):
        known.add(_divide(known.rows, ends, evaluate))
        ends, closed = _sort_pieces(known.rows, ends, limits)
        if len(closed):
            known.add(climb_faces(terrain, wheels.radius, known.rows, closed, evaluate))
    found = known.rows
    kept = (found.results["status"] != PoseStatus.NOT_SETTLED) | found.climbing
    kept[: len(rows) + len(inside)] = np.append(no_climb, inside)
    return join_crossings([found.select(np.flatnonzero(kept)), at_rest]).in_order()


_NOTHING = Crossings(
    np.empty(0), np.empty(0, np.int64), np.empty(0, bool), np.empty((0, 3)), new_results(0)
)


def _find_jumps(
    poses: np.ndarray, results: Any, joined: np.ndarray, limits: JumpLimits
) -> np.ndarray:
    """Return the neighbours between which to search, as rows (k, 2)."""
    jumps = np.empty((len(poses), 2), np.int64)
    return jumps[: find_jumps(results, poses, joined, limits, jumps)]


def _divide_turns(
    poses: np.ndarray, results: Any, joined: np.ndarray, limits: JumpLimits, evaluate: Evaluate
) -> tuple[Crossings, np.ndarray, np.ndarray]:
    """Return the poses of long turns, evenly from waypoint to waypoint.

    Also return a mask of those between waypoints, and the neighbours between which to search.
    """
    turns = np.empty((len(poses), 2), np.int64)
    turns = turns[: find_turns(results, poses, joined, limits, turns)]
    if not len(turns):
        return _NOTHING, np.empty(0, bool), np.empty((0, 2), np.int64)
    first, pieces = np.repeat(turns, turns[:, 1] + 1, axis=0).T
    within = np.concatenate([np.arange(count + 1) for count in turns[:, 1]])
    inside, share = (within > 0) & (within < pieces), within / pieces
    steps = poses[first + 1] - poses[first]
    steps[:, 2] = (steps[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    at = poses[first] + share[:, None] * steps
    found = select_results(results, np.where(within > 0, first + 1, first))
    place_results(evaluate(at[inside], NONE_HELD, found["motion"][inside]), found, inside)
    in_turns = Crossings(first + share, first + 1, np.zeros(len(at), bool), at, found)
    neighbours = _find_jumps(at, found, np.diff(within) > 0, limits)
    return in_turns, inside, neighbours


def turn_wheels(
    poses: np.ndarray, results: Any, joined: np.ndarray, evaluate: Evaluate
) -> Crossings:
    """Return the waypoints where the wheels turn, with the motion that leads on from there."""
    rows = np.empty(len(poses), np.int64)
    rows = rows[: find_turned_wheels(results, joined, rows)]
    if not len(rows):
        return _NOTHING
    at, motions = np.ascontiguousarray(poses[rows]), results["motion"][rows + 1]
    turned = evaluate(at, NONE_HELD, np.ascontiguousarray(motions))
    return Crossings(rows.astype(float), rows + 1, np.zeros(len(rows), bool), at, turned)


def _divide(known: Crossings, ends: np.ndarray, evaluate: Evaluate) -> Crossings:
    """Return PIECES - 1 evaluated poses in each stretch between the rows `ends` (k, 2)."""
    n = len(ends) * (PIECES - 1)
    place, waypoint, poses = np.empty(n), np.empty(n, np.int64), np.empty((n, 3))
    motions = np.empty((n, 3))
    divide_stretches(ends, PIECES, known.points, (place, waypoint, poses, motions))
    results = evaluate(poses, NONE_HELD, motions)
    return Crossings(place, waypoint, np.zeros(n, bool), poses, results)


def _sort_pieces(
    known: Crossings, ends: np.ndarray, limits: JumpLimits
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces in which a contact still jumps, as rows (j, 2): open ones, closed ones.

    The last rows of `known` are the poses within the stretches `ends`. `sort_pieces` defines open
    and closed.
    """
    pieces = np.empty((2, len(ends) * PIECES, 2), np.int64)
    n_open, n_closed = sort_pieces(ends, PIECES, known.points, limits, pieces)
    return pieces[0, :n_open], pieces[1, :n_closed]


def climb_faces(
    terrain: Terrain,
    radius: float,
    known: Crossings,
    ends: np.ndarray,
    evaluate: Evaluate,
) -> Crossings:
    """Evaluate wheels that jump up at one place, held at stages between foot and edge.

    Args:
        terrain: The ground.
        radius: Wheel radius [m].
        known: Evaluated poses.
        ends: (k, 2) rows of `known` before and after each place.
        evaluate: As for `find_crossings`.
    """
    before, after = known.results["wheel_centres"][ends].swapaxes(0, 1)
    rise = (after - before)[:, :, 2]
    climbing = rise > 0.05 * radius
    at = np.flatnonzero(np.any(climbing & (rise > HEIGHT_JUMP * radius), axis=1))
    if not len(at):
        return _NOTHING
    stages, foot, top = len(CLIMB_STAGES), ends[at, 0], ends[at, 1]
    row, wheel = np.nonzero(climbing[at])
    backward = known.results["wheel_speed"][top[row], wheel] < 0.0
    course = known.poses[foot[row], 2] + known.results["steering_angle"][top[row], wheel]
    centres = before[at[row], wheel]
    face, edge = _faces_ahead(terrain, radius, centres, course + np.where(backward, np.pi, 0.0))
    heights = centres[:, 2:] + CLIMB_STAGES * rise[at[row], wheel][:, None]
    angles = _angles_on_faces(radius, heights, face[:, None], edge[:, None])
    angles *= np.where(backward, -1.0, 1.0)[:, None]
    touching = (CLIMB_STAGES > 0.0) | (heights > edge[:, None])
    held = np.full((len(at), stages, 6, 2), np.nan)
    held[row, :, wheel] = np.where(
        touching[..., None], np.stack([heights, angles], axis=-1), np.nan
    )
    poses = np.repeat(known.poses[foot], stages, axis=0)
    motions = np.repeat(known.results["motion"][top], stages, axis=0)
    results = evaluate(poses, held.reshape(-1, 6, 2), motions)
    start, end = known.place[ends[at]].T[:, :, None]
    settled = (results["status"] == PoseStatus.SETTLED).reshape(-1, stages)
    climbs = Crossings(
        (start + CLIMB_STAGES * (end - start)).ravel(),
        np.repeat(known.waypoint[foot], stages),
        np.ones(len(poses), bool),
        poses,
        results,
    )
    return climbs.select((settled | ~settled.any(axis=1, keepdims=True)).ravel())


def _faces_ahead(
    terrain: Terrain, radius: float, centres: np.ndarray, yaw: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return slope angles [rad] and edge heights [m] (k,) of the ground ahead of wheel centres.

    Args:
        terrain: The ground.
        radius: Wheel radius [m].
        centres: (k, 3) wheel centres [m], map frame.
        yaw: (k,) courses [rad].
    """
    step = 0.25 * terrain.resolution
    ahead = np.arange(0.0, radius + 2.0 * terrain.resolution, step)
    heights = terrain.elevation_at(
        centres[:, :1] + ahead * np.cos(yaw)[:, None],
        centres[:, 1:2] + ahead * np.sin(yaw)[:, None],
    )
    steepest = np.fmax.reduce(np.diff(heights, axis=1) / step, axis=1)
    known = np.isfinite(steepest)
    face = np.where(known, np.arctan(steepest), 0.5 * np.pi)
    return face, np.where(known, np.fmax.reduce(heights, axis=1), np.inf)


def _angles_on_faces(
    radius: float, heights: np.ndarray, face: np.ndarray, edge: np.ndarray
) -> np.ndarray:
    """Return the contact angles [rad] of wheels with their centres at `heights` [m].

    A wheel touches the face while its centre is below the edge, then the edge.
    """
    above = (heights - edge) / radius
    on_edge = np.minimum(face, np.arccos(np.clip(above, 0.0, 1.0)))
    return np.where(above <= 0.0, face, on_edge)
