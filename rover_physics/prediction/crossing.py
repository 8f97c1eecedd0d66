# SPDX-License-Identifier: Apache-2.0
"""Poses between waypoints, where wheels climb faces, roll off edges, or sweep round in a turn.

A wheel contact can jump from one waypoint to the next. The poses in between then decide whether
the rover gets there. The path is divided around each jump until the jump is resolved, its place
decides nothing, or the piece is shorter than MIN_SPACING. A jump in height that remains is at one
place. Upwards, the wheel climbs a face: it is held at heights from foot to edge, with the face as
its contact, and evaluated at each. Downwards, the wheel drops.
"""

from typing import Any

import numpy as np

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
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

PIECES = 4
"""Number of pieces into which a stretch with a jump is divided in each round."""
TURNED = 0.1
"""Change of a steering angle [rad] from a waypoint to the next above which the rover is also
evaluated with the wheels turned where it still stands. Smaller changes count as gradual."""
TURN_SPACING = 0.25
"""Largest distance of the outermost wheel [wheel radii] between poses of a turn."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Fractions of a face's height at which a climbing wheel is evaluated. The foot (0) counts only if
the wheel already touches the edge of the face there: no later contact is as steep."""


def find_crossings(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray | bool = True
) -> Crossings:
    """Evaluate the poses between waypoints: at jumps, near limits, and where something turns far.

    Args:
        model: The model.
        poses: (n, 3) x, y [m] and yaw [rad] of the waypoints of one path, or of several paths
            one after the other, map frame.
        results: (n,) RESULT of each waypoint.
        joined: (n - 1,) True where a waypoint and the next one belong to the same path.

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
    rows = jumps.ravel()
    at_jumps = select_results(results, rows)
    path = Crossings(
        rows.astype(float), jumps[:, 1].repeat(2), none_held(len(rows)), poses[rows], at_jumps
    )
    known = join_crossings([path, turns])
    ends = np.vstack([np.arange(len(rows)).reshape(-1, 2), len(rows) + jumps_in_turns])
    while len(ends):
        known = join_crossings([known, _divide(model, known, ends)])
        pieces = np.empty((2, len(ends) * PIECES, 2), np.int64)
        n_open, n_closed = sort_pieces(ends, PIECES, known.views, model.wheels, pieces)
        ends, closed = pieces[0, :n_open], pieces[1, :n_closed]
        if len(closed):
            known = join_crossings([known, climb_faces(model, known, closed)])
    kept = (known.results["status"] != PoseStatus.NOT_SETTLED) | known.climbing
    kept[: len(rows) + len(inside)] = np.append(np.zeros(len(rows), bool), inside)
    return join_crossings([known.select(np.flatnonzero(kept)), at_rest]).in_order()


def list_jumps(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray
) -> np.ndarray:
    """Return the neighbours between which to search, as rows (k, 2)."""
    jumps = np.empty((len(poses), 2), np.int64)
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
        return NO_CROSSINGS, np.empty(0, bool), np.empty((0, 2), np.int64)
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
    """Evaluate PIECES - 1 poses in each stretch between the rows `ends` (k, 2), evenly.

    They are in the order of the stretches. Their motions are those of the end of the stretch,
    which lead there.
    """
    (before, after), within = ends.T, PIECES - 1
    share, first = np.arange(1, PIECES) / PIECES, known.place[before]
    place = first[:, None] + share * (known.place[after] - first)[:, None]
    steps = steps_between(known.poses[before], known.poses[after])
    poses = known.poses[before][:, None] + share[:, None] * steps[:, None]
    at, motions = poses.reshape(-1, 3), np.repeat(known.results["motion"][after], within, axis=0)
    waypoint = np.repeat(known.waypoint[before], within)
    results = model.evaluate(at, motions=motions)
    return Crossings(place.ravel(), waypoint, none_held(len(at)), at, results)


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
