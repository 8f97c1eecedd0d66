# SPDX-License-Identifier: Apache-2.0
"""Entrapment: a path is refused if the rover can drive in, but neither on nor back out.

Driving back differs from driving in for three reasons. A wheel that dropped off an edge has to
climb it on the way back. Soil resists motion in either direction, so it helps the rover to brake
downhill and hinders it uphill. Speed servos pull by their slip, which depends on the direction. On
Coulomb ground without drops and servos, the forces at rest are the same both ways, so a path that
is passable on the way in is passable on the way back.

The way back is therefore predicted only if the forces of the way in are not enough for it. It
leads backwards from the end of the path, or from where the path fails, to a point before all such
places. The waypoint where the way back fails is the point of no return. Ways on are then checked,
straight ahead and in curves: from the end of the path, and from just past the point of no return.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rover_physics.forces.soil import use_of_shear
from rover_physics.limits.table import TRAPPED
from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.sweep import (
    PART,
    SweptPath,
    predict_in_parts,
    predict_paths,
    predict_way_back,
)
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import find_uses
from rover_physics.traversability.verdict import Verdict, hold_against_limits, with_refusals

LOOK_AHEAD = 1.5
"""Length of a way on [wheelbases], in addition to the distance from the point of no return."""
MAX_LOOK_AHEAD = 6.0
"""Largest length of a way on [wheelbases]."""
CURVES = (0.0, 1.0, -1.0)
"""Curvatures of the ways on [rad per wheelbase]; they hold for LOOK_AHEAD wheelbases."""
SERVO_USE = 0.8
"""Share of the tractions that friction and motors can give, used by a rover with speed servos on
the way in, above which the way back is checked."""
DROP = 0.1
"""Drop of a wheel [wheel radii] above which the way back is checked."""
RUN_UP = 1.0
"""Distance [wheelbases] before the first place that needs a check where the way back ends."""
SPACING = 0.2
"""Least step of a way on [wheel radii]; poses of a path may be arbitrarily close together."""
UNKNOWN_CODES = ("off_map", "unknown_ground")
"""Codes that close a way on only within LOOK_AHEAD wheelbases; farther ground may be open."""


@dataclass(frozen=True, eq=False)
class Course:
    """The part of a judged path that is checked for entrapment; reaches its first failure."""

    path: np.ndarray
    """(k, 3) all poses of the path."""
    distance: np.ndarray
    """(n,) horizontal distance of the judged waypoints since the first [m]."""
    irreversible: np.ndarray
    """(n,) True where the way back has to be judged, see `_find_irreversible`."""
    drop: np.ndarray
    """(n,) largest drop of a wheel at a waypoint or since the one before [m]."""
    direction: np.ndarray
    """(n,) 1 where the rover drives forwards, -1 backwards; on the spot as the options have it."""
    swept: SweptPath | None
    """The sweep of the way in; None if it was not kept."""


def course_of(
    model: PackedModel, path: np.ndarray, prediction: PathPrediction, swept: SweptPath | None
) -> Course:
    """Return the course of what the model predicts of a path (k, 3)."""
    ahead = prediction.motion[:, 0]
    return Course(
        path,
        prediction.distance,
        _find_irreversible(model, prediction),
        prediction.wheel_drop.max(axis=1),
        np.where(ahead == 0.0, model.options.direction, np.sign(ahead)),
        swept,
    )


def refuse_if_trapped(model: PackedModel, course: Course, verdict: Verdict) -> Verdict:
    """Return the verdict, refused as "trapped" if there is neither a way on nor a way back.

    Args:
        model: The model of the sweep.
        course: The path.
        verdict: The verdict on it.
    """
    rover, distance = model.rover, course.distance
    end = len(distance) if verdict.first_failure < 0 else verdict.first_failure
    irreversible = np.flatnonzero(course.irreversible[:end])
    if not irreversible.size:
        return verdict
    run_up = distance[irreversible[0]] - RUN_UP * rover.wheelbase
    inside = slice(int(np.searchsorted(distance, max(run_up, 0.0))), end)
    back = _judge_way_back(model, course, inside)
    if back.traversable:
        return verdict
    stop = end - 1 - back.first_failure  # the way back is blocked here
    on = _explain_no_way_on(model, course, slice(stop, end))
    if not on:
        return verdict
    drop = course.drop[stop:end].max(initial=0.0)
    fell = drop > DROP * rover.wheel.radius
    what = f"a wheel drops {drop:.3f} m" if fell else "from here the rover goes in but not out"
    exits = f"no way on: {verdict.reason or on}; no way back: {back.reason}"
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    codes[stop], reasons[stop] = TRAPPED, f"trapped: {what}; {exits}"
    return with_refusals(verdict, codes, reasons)


def _find_irreversible(model: PackedModel, prediction: PathPrediction) -> np.ndarray:
    """Return (n,) True at or just after places where the forces of the way in allow no return.

    Under policy "optimal" other torques may allow it; these are only the places to check.
    """
    irreversible = np.any(prediction.wheel_drop > DROP * model.rover.wheel.radius, axis=1)
    for part in (prediction, prediction.between):
        if part is not None:
            irreversible[part.waypoint[_resists_way_back(model, part)]] = True
    return np.asarray(irreversible)


def _resists_way_back(model: PackedModel, prediction: PathPrediction) -> np.ndarray:
    """Return (n,) True where driving back needs more than it did to drive in.

    On yielding soil, this is where the same forces, reversed, break a limit. Speed servos pull
    with other forces on the way back, so that it is where they used more than SERVO_USE of what
    friction and motors can give on the way in.
    """
    radius, most = model.rover.wheel.radius, float(model.settings.max_torque)
    if model.options.policy == SERVO:
        grip = prediction.friction * np.maximum(prediction.wheel_loads, 0.0)
        used = np.abs(prediction.tangential).sum(axis=1)
        return np.asarray(used > SERVO_USE * np.minimum(grip, most / radius).sum(axis=1))
    resistance = prediction.motion_resistance
    if not np.any(resistance > 0.0):
        return np.zeros(len(resistance), dtype=bool)
    wheels = np.nonzero(resistance > 0.0)
    direction = np.where(prediction.wheel_speed[wheels] < 0.0, -1.0, 1.0)
    R, N = resistance[wheels], prediction.wheel_loads[wheels]
    T, S = -direction * prediction.tangential[wheels], prediction.lateral[wheels]
    largest = prediction.friction[wheels] * N + R
    friction, torque = np.zeros(resistance.shape), np.zeros(resistance.shape)
    friction[wheels] = np.vectorize(use_of_shear, otypes=[float])(T, S, R, largest)
    torque[wheels] = radius * np.abs(T + R) / most
    back = prediction.change(friction_utilisation=friction, torque_saturation=torque)
    uses = find_uses(model.limits, back.results)
    by_forces = [row.code in ("friction", "torque") for row in uses.limits.rows]
    return np.asarray(prediction.settled & (uses.use[:, by_forces] > 1.0).any(axis=1))


def _judge_way_back(model: PackedModel, course: Course, waypoints: slice) -> Verdict:
    """Judge the way back over waypoints; from the results of the way in where they do not differ.

    They do on soil and with speed servos.
    """
    reverse = model.change(backward=not model.options.backward)
    if course.swept is None or reverse.settings.on_soil or reverse.options.policy == SERVO:
        return _judge_escape(reverse, course.path[waypoints][::-1])
    back = predict_way_back(reverse, course.swept, waypoints)
    return hold_against_limits(model.rover, back)


def _judge_escape(model: PackedModel, poses: np.ndarray) -> Verdict:
    """Judge a path out by the first of `escape_policies` that passes it, else by the last."""
    for policy in escape_policies(model.options):
        verdict = _judge_to_failure(model.change(policy=policy), np.ascontiguousarray(poses))
        if verdict.traversable:
            break
    return verdict


def _judge_to_failure(model: PackedModel, poses: np.ndarray) -> Verdict:
    """Judge a path out up to its first failure; long ones in parts, to keep little in memory."""
    if len(poses) <= PART:
        swept = predict_paths(model, [poses], stop_at_failure=True)[0]
        return hold_against_limits(model.rover, swept.prediction)
    for part in predict_in_parts(model, poses):
        verdict = hold_against_limits(model.rover, part.prediction)
        if not verdict.traversable:
            return replace(verdict, first_failure=part.start + verdict.first_failure)
    return verdict


def escape_policies(options: SweepOptions) -> tuple[str, ...]:
    """Return the policies under which ways on and back are judged, in this order.

    What equal torques pass, optimal ones pass too, and equal ones are faster. Speed servos have
    tractions of their own, which may fail where equal ones hold.
    """
    return (EQUAL, OPTIMAL) if options.policy == OPTIMAL else (options.policy,)


def _explain_no_way_on(model: PackedModel, course: Course, inside: slice) -> str:
    """Return why the first way on, straight ahead from the end, is closed; empty if any is open.

    The rover can move within the waypoints `inside`.
    """
    wheelbase, distance = model.rover.wheelbase, course.distance
    end = inside.stop - 1
    room = distance[end] - distance[inside.start]
    length = min(LOOK_AHEAD * wheelbase + room, MAX_LOOK_AHEAD * wheelbase)
    starts = [end]
    if room > wheelbase:
        behind = distance[inside.start] + 0.5 * wheelbase
        starts.append(int(np.searchsorted(distance, behind)))
    steps = count_steps(course.path, length, model.rover.wheel.radius)
    ahead = np.linspace(0.0, length, steps + 1)
    closed = ""
    for start in starts:
        for path in _paths_ahead(course.path[start], wheelbase, ahead, course.direction[start]):
            # From the pose before it, so that the wheels of a curve are turned on the ground.
            poses = np.vstack([course.path[max(start - 1, 0)], path])
            verdict = _judge_escape(model, poses)
            if verdict.traversable:
                return ""
            far = verdict.first_failure * (length / steps) > LOOK_AHEAD * wheelbase
            if verdict.code in UNKNOWN_CODES and far:
                return ""
            closed = closed or verdict.reason
    return closed


def _paths_ahead(
    pose: np.ndarray, wheelbase: float, ahead: np.ndarray, direction: float
) -> Iterator[np.ndarray]:
    """Yield paths (n, 3) on from a pose (3,): straight, then curves that end straight.

    `ahead` (n,) are the distances of their poses [m], from 0 on.
    """
    turning = np.minimum(ahead, LOOK_AHEAD * wheelbase) / wheelbase
    spacing = ahead[-1] / (len(ahead) - 1)
    for curve in CURVES:
        yaw = pose[2] + curve * turning
        middle = yaw[:-1] + 0.5 * np.diff(yaw)
        step = direction * spacing * np.column_stack([np.cos(middle), np.sin(middle)])
        places = pose[:2] + np.vstack([np.zeros(2), np.cumsum(step, axis=0)])
        yield np.column_stack([places, yaw])


def count_steps(path: np.ndarray, length: float, radius: float) -> int:
    """Return the number of steps of a path of `length` [m], about as long as those of a path.

    Their median counts, of poses that are apart, but at least SPACING of wheels of `radius` [m].
    """
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    steps = steps[steps > 0.0]
    usual = float(np.median(steps)) if steps.size else 0.0
    spacing = max(usual, SPACING * radius)
    return int(np.ceil(length / spacing - 1e-6))
