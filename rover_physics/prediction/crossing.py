# SPDX-License-Identifier: Apache-2.0
"""Poses between waypoints, where wheels climb faces, roll off edges, or sweep round in a turn.

A wheel contact can jump from one waypoint to the next. The poses in between then decide whether
the rover gets there. The path is divided around each jump until the jump is resolved, its place
decides nothing, or the piece is shorter than MIN_SPACING. A jump in height that remains is at one
place. Upwards, the wheel climbs a face: it is held at heights from foot to edge, with the face as
its contact, and evaluated at each. Downwards, the wheel drops.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.prediction.failures import mark_failures
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import (
    HEIGHT_JUMP,
    NO_CROSSINGS,
    Crossings,
    find_jumps,
    join_crossings,
    none_held,
    sort_pieces,
    steps_between,
)
from rover_physics.results.record import place_results, select_results
from rover_physics.results.uses import readable
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

TURNED = 0.1
"""Change of a steering angle [rad] from a waypoint to the next above which the rover is also
evaluated with the wheels turned where it still stands. Smaller changes count as gradual."""
TURN_SPACING = 0.25
"""Largest distance of the outermost wheel [wheel radii] between poses of a turn."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Fractions of a face's height at which a climbing wheel is evaluated. The foot (0) counts only if
the wheel already touches the edge of the face there: no later contact is as steep."""


class AtFailure(IntEnum):
    """What is searched no further once a pose between waypoints fails in any case."""

    SEARCH_ON = 0
    """Nothing: all is searched."""
    LEAVE_REST = 1
    """The rest of its path."""
    LEAVE_PATH = 2
    """Its whole path."""


def find_crossings(
    model: PackedModel,
    poses: np.ndarray,
    results: Any,
    joined: np.ndarray | bool = True,
    at_failure: AtFailure = AtFailure.SEARCH_ON,
) -> Crossings:
    """Evaluate the poses between waypoints: at jumps, near limits, and where something turns far.

    Args:
        model: The model.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints of one path, or of several paths
            one after the other, map frame.
        results: (n,) RESULT of each waypoint.
        joined: (n - 1,) True where a waypoint and the next one belong to the same path.
        at_failure: What is left out; with speed servos nothing, for momentum may carry the rover.

    Returns:
        The poses between the waypoints, without those of status NOT_SETTLED; poses of climbing
        wheels and those that divide a long turn are kept in any case.
    """
    joined = np.broadcast_to(joined, len(poses) - 1)
    at_rest = turn_wheels(model, poses, results, joined)
    jumps = list_jumps(model, poses, results, joined)
    turns, inside, jumps_in_turns = _divide_turns(model, poses, results, joined)
    if not len(jumps) and not len(inside):
        return at_rest
    rows = jumps[:, :2].ravel()
    at_jumps = select_results(results, rows)
    path = Crossings(
        rows.astype(float), jumps[:, 1].repeat(2), none_held(len(rows)), poses[rows], at_jumps
    )
    known = join_crossings([path, turns])
    jumps[:, :2] = np.arange(len(rows)).reshape(-1, 2)
    jumps_in_turns[:, :2] += len(rows)
    ends, path_of = np.vstack([jumps, jumps_in_turns]), np.append(0, np.cumsum(~joined))
    while len(ends):
        start = len(known.place)
        known = join_crossings([known, _divide(model, known, ends)])
        ends, closed = _sort_pieces(model, known, ends)
        if len(closed):
            known = join_crossings([known, climb_faces(model, known, closed)])
        if at_failure and not model.wheels.on_servos:
            failed = _find_failures(model, known.select(slice(start, None)))
            ends = ends[_are_ahead(known.waypoint[ends[:, 0]], failed, path_of, at_failure)]
    kept = (known.results["status"] != PoseStatus.NOT_SETTLED) | known.climbing
    kept[: len(rows) + len(inside)] = np.append(np.zeros(len(rows), bool), inside)
    return join_crossings([known.select(np.flatnonzero(kept)), at_rest]).in_order()


def _sort_pieces(
    model: PackedModel, known: Crossings, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces to divide (k, 3) and to close (m, 2), of stretches that are divided."""
    count = int(ends[:, 2].sum())
    to_divide, to_close = np.empty((count, 3), np.int64), np.empty((count, 2), np.int64)
    found = sort_pieces(ends, known.views, model.wheels, to_divide, to_close)
    return to_divide[: found[0]], to_close[: found[1]]


def _find_failures(model: PackedModel, found: Crossings) -> NDArray[np.int64]:
    """Return the waypoints that follow poses which fail in any case."""
    fails = np.empty(len(found.place), bool)
    mark_failures(*readable(found.results), model.limits.records, model.wheels, fails)
    fails &= (found.results["status"] != PoseStatus.NOT_SETTLED) | found.climbing
    return found.waypoint[fails]


def _are_ahead(
    waypoints: NDArray[np.int64],
    failed: NDArray[np.int64],
    path_of: NDArray[np.int64],
    at_failure: AtFailure,
) -> NDArray[np.bool_]:
    """Return which waypoints (k,) failures leave to be searched.

    `failed` are the waypoints at which paths fail, `path_of` (n,) is the path of each waypoint.
    """
    last = np.full(len(path_of), len(path_of))
    np.minimum.at(last, path_of[failed], -1 if at_failure == AtFailure.LEAVE_PATH else failed)
    return np.asarray(waypoints <= last[path_of[waypoints]])


def list_jumps(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray
) -> np.ndarray:
    """Return the neighbours between which to search, and numbers of pieces to divide them into."""
    jumps = np.empty((len(poses), 3), np.int64)
    joined = np.array(joined)  # a kernel is compiled for each layout, and for read-only arrays
    return jumps[: find_jumps(results, poses, joined, model.wheels, jumps)]


def _divide_turns(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray
) -> tuple[Crossings, np.ndarray, np.ndarray]:
    """Return the poses of long turns, evenly from waypoint to waypoint.

    Also return a mask of those between waypoints, and the neighbours between which to search.
    """
    turns = find_turns(model, poses, results, joined)
    if not len(turns):
        return NO_CROSSINGS, np.empty(0, bool), np.empty((0, 3), np.int64)
    first, pieces = np.repeat(turns, turns[:, 1] + 1, axis=0).T
    within = np.concatenate([np.arange(count + 1) for count in turns[:, 1]])
    inside, share = (within > 0) & (within < pieces), within / pieces
    steps = steps_between(poses[first], poses[first + 1])
    at = poses[first] + share[:, None] * steps
    found = select_results(results, np.where(within > 0, first + 1, first))
    turned = model.evaluate(at[inside], motions=found["motion"][inside])
    place_results(turned, found, inside)
    in_turns = Crossings(first + share, first + 1, none_held(len(at)), at, found)
    return in_turns, inside, list_jumps(model, at, found, np.diff(within) > 0)


def turn_wheels(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray
) -> Crossings:
    """Return the waypoints where the wheels turn, with the motion that leads on from there."""
    changes = np.abs(np.diff(results["steering_angle"], axis=0)).max(axis=1)
    rows = np.flatnonzero(joined & (changes > TURNED))
    if not len(rows):
        return NO_CROSSINGS
    at, motions = np.ascontiguousarray(poses[rows]), results["motion"][rows + 1]
    turned = model.evaluate(at, motions=np.ascontiguousarray(motions))
    return Crossings(rows.astype(float), rows + 1, none_held(len(rows)), at, turned)


def find_turns(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray
) -> np.ndarray:
    """Find the steps that turn so far that the wheels sweep ground away from both waypoints.

    On such a step the outermost wheel goes farther by turning than a wheel radius, and than the
    body goes.

    Returns:
        (k, 2) first waypoints of these steps and numbers of pieces TURN_SPACING apart.
    """
    wheels, steps = model.wheels, steps_between(poses[:-1], poses[1:])
    swing = wheels.swing_radius * np.abs(steps[:, 2])
    far = swing > np.maximum(wheels.radius, np.hypot(steps[:, 0], steps[:, 1]))
    rows = np.flatnonzero(joined & far & (results["motion"][1:, 2] != 0.0))
    pieces = np.ceil(swing[rows] / (TURN_SPACING * wheels.radius)).astype(np.int64)
    return np.column_stack([rows, pieces])


def _divide(model: PackedModel, known: Crossings, ends: np.ndarray) -> Crossings:
    """Evaluate the poses that divide each stretch evenly.

    They are in the order of the stretches. Their motions are those of the end of the stretch,
    which lead there.

    Args:
        model: The model.
        known: Evaluated poses.
        ends: (k, 3) rows of `known` at the start and end of each stretch, and numbers of pieces.
    """
    before, after, pieces = np.repeat(ends, ends[:, 2] - 1, axis=0).T
    last = np.cumsum(ends[:, 2] - 1)
    share = (
        1 + np.arange(len(before)) - np.repeat(last - ends[:, 2] + 1, ends[:, 2] - 1)
    ) / pieces
    place = known.place[before] + share * (known.place[after] - known.place[before])
    steps = steps_between(known.poses[before], known.poses[after])
    poses = known.poses[before] + share[:, None] * steps
    results = model.evaluate(poses, motions=known.results["motion"][after])
    return Crossings(place, known.waypoint[before], none_held(len(poses)), poses, results)


def climb_faces(model: PackedModel, known: Crossings, ends: np.ndarray) -> Crossings:
    """Evaluate wheels that jump up at one place, held at stages between foot and edge.

    Args:
        model: The model.
        known: Evaluated poses.
        ends: (k, 2) rows of `known` before and after each place.
    """
    terrain, radius = model.terrain, model.wheels.radius
    before, after = known.results["wheel_centres"][ends].swapaxes(0, 1)
    rise = (after - before)[:, :, 2]
    climbing = rise > 0.05 * radius
    at = np.flatnonzero(np.any(climbing & (rise > HEIGHT_JUMP * radius), axis=1))
    if not len(at):
        return NO_CROSSINGS
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
    held = none_held(len(at) * stages).reshape(len(at), stages, 6, 2)
    held[row, :, wheel] = np.stack([np.where(touching, heights, np.nan), angles], axis=-1)
    poses = np.repeat(known.poses[foot], stages, axis=0)
    motions = np.repeat(known.results["motion"][top], stages, axis=0)
    results = model.evaluate(poses, held.reshape(-1, 6, 2), motions)
    start, end = known.place[ends[at]].T[:, :, None]
    settled = (results["status"] == PoseStatus.SETTLED).reshape(-1, stages)
    climbs = Crossings(
        (start + CLIMB_STAGES * (end - start)).ravel(),
        np.repeat(known.waypoint[foot], stages),
        held.reshape(-1, 6, 2),
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
