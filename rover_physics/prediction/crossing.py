# SPDX-License-Identifier: Apache-2.0
"""Poses between waypoints, where wheels climb faces, roll off edges, or sweep round in a turn.

A wheel contact can jump from one waypoint to the next. The poses in between then decide whether
the rover gets there. The path is halved around each jump until the jump is resolved, its place
decides nothing, or the stretch is shorter than MIN_SPACING (see `halving.py`). A jump in height
that remains is at one place. Upwards, the wheel climbs a face: it is held at heights from foot to
edge, with the face as its contact, and evaluated at each. Downwards, the wheel drops.
"""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.threads import limit_threads, run_in_turn
from rover_physics.prediction.evaluation import NONE_HELD, evaluate_poses, new_works
from rover_physics.prediction.halving import CLOSED, NEXT, ROWS, AtFailure, Stretches
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import (
    HEIGHT_JUMP,
    LONGEST_STEP,
    NO_CROSSINGS,
    Crossings,
    find_jumps,
    join_crossings,
    none_held,
    steps_between,
)
from rover_physics.results.record import (
    forget_uncomputable,
    new_results,
    place_results,
    select_results,
)
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

TURNED = 0.1
"""Change of a steering angle [rad] from a waypoint to the next above which the rover is also
evaluated with the wheels turned where it still stands. Smaller changes count as gradual."""
TURN_SPACING = 0.25
"""Largest distance of the outermost wheel [wheel radii] between poses of a turn."""
GROUP = 32
"""Number of stretches that are halved together."""
POSES_IN_STRETCH = 8
"""Space for so many poses is provided for each stretch at a time."""
Searched = tuple[NDArray[np.int64], NDArray[np.int64], int]
"""The last fields of `Stretches`."""
CLIMB_STAGES = np.linspace(0.0, 1.0, 6)
"""Fractions of a face's height at which a climbing wheel is evaluated. The foot (0) counts only if
the wheel already touches the edge of the face there: no later contact is as steep."""


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
    rows = jumps.ravel()
    at_jumps = select_results(results, rows)
    path = Crossings(
        rows.astype(float), jumps[:, 1].repeat(2), none_held(len(rows)), poses[rows], at_jumps
    )
    evaluated = join_crossings([path, turns])
    ends = np.vstack([np.arange(len(rows)).reshape(-1, 2), len(rows) + jumps_in_turns])
    path_of = np.append(0, np.cumsum(~joined))
    at_failure = AtFailure.SEARCH_ON if model.on_servos else at_failure
    last = np.full(path_of[-1] + 1, len(path_of))
    searched = last, path_of, int(at_failure)
    found = _halve_in_turn(model, evaluated, ends, searched)
    in_turns = evaluated.select(len(rows) + np.flatnonzero(inside))
    return join_crossings([in_turns, *found, at_rest]).in_order()


def _halve_in_turn(
    model: PackedModel, evaluated: Crossings, ends: NDArray[np.int64], searched: Searched
) -> list[Crossings]:
    """Evaluate the poses within stretches, in groups by threads.

    Args:
        model: The model.
        evaluated: Evaluated poses.
        ends: (k, 2) rows of them at the ends of the stretches.
        searched: The last fields of `Stretches`.
    """
    groups = np.array_split(ends, -(-len(ends) // GROUP)) if len(ends) else []
    found = [NO_CROSSINGS] * len(groups)

    def halve(k: int) -> None:
        found[k] = _halve(model, evaluated.select(groups[k].ravel()), searched)

    with limit_threads(model.relative_cost(POSES_IN_STRETCH * len(ends))) as threads:
        run_in_turn((partial(halve, k) for k in range(len(groups))), threads)
    return found


def _halve(model: PackedModel, pairs: Crossings, searched: Searched) -> Crossings:
    """Evaluate the poses within stretches, and those of wheels that climb there.

    Args:
        model: The model.
        pairs: (2k,) evaluated poses, by twos the ends of a stretch.
        searched: As for `_halve_in_turn`.
    """
    first, stretches = len(pairs.place), len(pairs.place) // 2
    numbers = np.array([first, first + stretches, 0])
    ends = np.vstack([np.zeros((first, 2), np.int64), np.arange(first).reshape(-1, 2)])
    closed, works, found = np.empty((0, 2), np.int64), new_works(1, 1), pairs
    while numbers[NEXT] < numbers[ROWS]:
        check_interruption()
        more = numbers[ROWS] - len(found.place) + POSES_IN_STRETCH * stretches + 2
        found = join_crossings([found, _unasked(more)])
        rows = len(found.place)
        ends, closed = (np.resize(rows_of, (rows, 2)) for rows_of in (ends, closed))
        asked = Stretches(ends, found.place, found.waypoint, closed, numbers, *searched)
        places = found.poses, np.empty((rows, 3)), NONE_HELD
        sweep = model.records[None], model.limits.records, *places, asked, works, found.results
        evaluate_poses(*sweep, 0, 1)
    end, (last, path_of, *_) = numbers[ROWS], searched
    forget_uncomputable(found.results[first:end])
    closed = closed[: numbers[CLOSED]]
    waypoint = found.waypoint[closed[:, 0]]
    climbs = climb_faces(model, found, closed[waypoint <= last[path_of[waypoint]]])
    settled = found.results["status"][first:end] != PoseStatus.NOT_SETTLED
    return join_crossings([found.select(first + np.flatnonzero(settled)), climbs])


def _unasked(count: int) -> Crossings:
    """Return so many rows for poses to come."""
    return Crossings(
        np.empty(count), np.zeros(count, np.int64), none_held(count),
        np.empty((count, 3)), new_results(count),
    )  # fmt: skip


def list_jumps(
    model: PackedModel, poses: np.ndarray, results: Any, joined: np.ndarray
) -> np.ndarray:
    """Return the neighbours between which to search, as rows (k, 2)."""
    jumps = np.empty((len(poses), 2), np.int64)
    joined = np.array(joined)  # a kernel is compiled for each layout, and for read-only arrays
    return jumps[: find_jumps(model.records, results, poses, joined, jumps)]


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
    radius, steps = model.rover.wheel.radius, steps_between(poses[:-1], poses[1:])
    swing = swing_radius(model.rover) * np.abs(steps[:, 2])
    far = swing > np.maximum(LONGEST_STEP * radius, np.hypot(steps[:, 0], steps[:, 1]))
    rows = np.flatnonzero(joined & far & (results["motion"][1:, 2] != 0.0))
    pieces = np.ceil(swing[rows] / (TURN_SPACING * radius)).astype(np.int64)
    return np.column_stack([rows, pieces])


def climb_faces(model: PackedModel, evaluated: Crossings, ends: np.ndarray) -> Crossings:
    """Evaluate wheels that jump up at one place, held at stages between foot and edge.

    Args:
        model: The model.
        evaluated: Evaluated poses.
        ends: (k, 2) rows of them before and after each place.
    """
    terrain, radius = model.terrain, model.rover.wheel.radius
    before, after = evaluated.results["wheel_centres"][ends].swapaxes(0, 1)
    rise = (after - before)[:, :, 2]
    climbing = rise > 0.05 * radius
    at = np.flatnonzero(np.any(climbing & (rise > HEIGHT_JUMP * radius), axis=1))
    if not len(at):
        return NO_CROSSINGS
    stages, foot, top = len(CLIMB_STAGES), ends[at, 0], ends[at, 1]
    row, wheel = np.nonzero(climbing[at])
    backward = evaluated.results["wheel_speed"][top[row], wheel] < 0.0
    course = evaluated.poses[foot[row], 2] + evaluated.results["steering_angle"][top[row], wheel]
    centres = before[at[row], wheel]
    face, edge = _faces_ahead(terrain, radius, centres, course + np.where(backward, np.pi, 0.0))
    heights = centres[:, 2:] + CLIMB_STAGES * rise[at[row], wheel][:, None]
    angles = _angles_on_faces(radius, heights, face[:, None], edge[:, None])
    angles *= np.where(backward, -1.0, 1.0)[:, None]
    touching = (CLIMB_STAGES > 0.0) | (heights > edge[:, None])
    held = none_held(len(at) * stages).reshape(len(at), stages, 6, 2)
    held[row, :, wheel] = np.stack([np.where(touching, heights, np.nan), angles], axis=-1)
    poses = np.repeat(evaluated.poses[foot], stages, axis=0)
    motions = np.repeat(evaluated.results["motion"][top], stages, axis=0)
    results = model.evaluate(poses, held.reshape(-1, 6, 2), motions)
    start, end = evaluated.place[ends[at]].T[:, :, None]
    settled = (results["status"] == PoseStatus.SETTLED).reshape(-1, stages)
    climbs = Crossings(
        (start + CLIMB_STAGES * (end - start)).ravel(),
        np.repeat(evaluated.waypoint[foot], stages),
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
