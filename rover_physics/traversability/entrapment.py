"""Trapped? A path is refused where the rover can go in, but neither on nor back.

What differs between driving in and driving back are edges, off which a wheel drops and which it
has to climb on the way back, and soil, whose resistance holds the rover going up as much as it
brakes it going down. On Coulomb ground without drops the forces of the rover at rest are the same
both ways: whatever was passable on the way in is passable on the way back.

So the way back is driven, backwards, only where the forces of the way in would not do for it. It
leads from where the path ends, or fails, to before all such places. Where it fails is the point of
no return, and then a way on is looked for: straight ahead and in curves, from the end and from
just behind the point of no return.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rover_physics.forces.soil import use_of_shear
from rover_physics.names import EQUAL
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.limit_checks import TOLERANCE, largest_of
from rover_physics.traversability.verdict import Verdict, judge

LOOK_AHEAD = 1.5
"""Wheelbases that the way on is looked at beyond as much way as the rover went in."""
MAX_LOOK_AHEAD = 6.0
"""Wheelbases that the way on is looked at, however far the rover went in."""
CURVES = (0.0, 1.0, -1.0)
"""Curvatures of the ways on, in turns of one radian a wheelbase, for LOOK_AHEAD wheelbases."""
DROP = 0.1
"""Drop, in wheel radii, from which on the way back is asked for."""
RUN_UP = 1.0
"""Wheelbases before the first place that needs asking to which the way back has to lead."""
UNKNOWN_CODES = ("off_map", "unknown_ground")
"""Codes that close a way on only within LOOK_AHEAD wheelbases; what lies further is not known."""


def ask_for_ways_out(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    verdict: Verdict,
    options: SweepOptions,
) -> Verdict:
    """Return the verdict, refused as trapped where there is neither a way on nor back."""
    end = len(prediction.poses) if verdict.first_failure < 0 else verdict.first_failure
    one_way = np.flatnonzero(_find_one_way(rover, prediction, options)[:end])
    if not one_way.size:
        return verdict
    run_up = prediction.distance[one_way[0]] - RUN_UP * _wheelbase(rover)
    first = int(np.searchsorted(prediction.distance, max(run_up, 0.0)))
    reverse = replace(options, backward=not options.backward)
    back = _judge_way(rover, terrain, prediction.poses[first:end][::-1], reverse)
    if back.traversable:
        return verdict
    stop = end - 1 - back.first_failure  # the way back is blocked here
    on = _find_way_on(rover, terrain, prediction, stop, end - 1, options)
    if not on:
        return verdict
    on = verdict.reason or on
    return _refuse(rover, prediction, verdict, stop, end, f"{on}; no way back: {back.reason}")


def _find_one_way(rover: Rover, prediction: PathPrediction, options: SweepOptions) -> np.ndarray:
    """Return (n,) True where, or just before where, the forces of the way in do not do for back.

    Another set of torques may do, under policy "optimal"; this only tells where to ask.
    """
    one_way = np.any(prediction.wheel_drop > DROP * rover.wheel.radius, axis=1)
    for part in (prediction, prediction.between):
        if part is not None:
            rows = _resists_way_back(rover, part, options)
            one_way[part.waypoint[rows]] = True
    return np.asarray(one_way)


def _resists_way_back(
    rover: Rover, prediction: PathPrediction, options: SweepOptions
) -> np.ndarray:
    """Return (n,) True where driving back with the same forces breaks a limit on some soil."""
    resistance = prediction.motion_resistance
    if not largest_of(resistance) > 0.0:
        return np.zeros(len(resistance), dtype=bool)
    broken = np.zeros(resistance.shape, dtype=bool)
    wheels = np.nonzero(resistance > 0.0)
    direction = options.direction
    R, N = resistance[wheels], prediction.wheel_loads[wheels]
    T, S = -direction * prediction.tangential[wheels], prediction.lateral[wheels]
    largest = prediction.friction[wheels] * N + R
    use = np.vectorize(use_of_shear, otypes=[float])(T, S, R, largest)
    most = options.max_torque or rover.wheel.max_torque
    saturation = rover.wheel.radius * np.abs(T + R) / most
    limits = rover.limits
    broken[wheels] = (use > limits.friction_utilisation + TOLERANCE) | (
        saturation > limits.torque_saturation + TOLERANCE
    )
    return np.asarray(broken.any(axis=1))


def _judge_way(
    rover: Rover, terrain: Terrain, poses: np.ndarray, options: SweepOptions
) -> Verdict:
    """Judge a way; under whatever policy, equal torques are asked first: that is much faster."""
    equal = replace(options, policy=EQUAL)
    verdict = judge(rover, sweep_path(rover, terrain, poses, equal))
    if verdict.traversable or options.policy == EQUAL:
        return verdict
    return judge(rover, sweep_path(rover, terrain, poses, options))


def _wheelbase(rover: Rover) -> float:
    wheels = rover.suspension.wheels
    return wheels["front"][0] - wheels["rear"][0]


def _find_way_on(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    stop: int,
    end: int,
    options: SweepOptions,
) -> str:
    """Return why the rover can't go on straight ahead from the end, empty if any way on is open.

    `stop` and `end` are the waypoints between which it can move.
    """
    wheelbase = _wheelbase(rover)
    inside = prediction.distance[end] - prediction.distance[stop]
    length = min(LOOK_AHEAD * wheelbase + inside, MAX_LOOK_AHEAD * wheelbase)
    starts = [end]
    if inside > wheelbase:
        behind = prediction.distance[stop] + 0.5 * wheelbase
        starts.append(int(np.searchsorted(prediction.distance, behind)))
    spacing = _spacing(prediction)
    closed = ""
    for start in starts:
        for poses in _ways_ahead(prediction.poses[start], wheelbase, length, spacing, options):
            verdict = _judge_way(rover, terrain, poses, options)
            if verdict.traversable:
                return ""
            far = verdict.first_failure * spacing > LOOK_AHEAD * wheelbase
            if verdict.code in UNKNOWN_CODES and far:
                return ""
            closed = closed or verdict.reason
    return closed


def _ways_ahead(
    pose: np.ndarray, wheelbase: float, length: float, spacing: float, options: SweepOptions
) -> Iterator[np.ndarray]:
    """Yield ways (m, 3) on from a pose: straight on, and in curves that then go straight on."""
    direction = options.direction
    ahead = np.arange(0.0, length + spacing, spacing)
    turning = np.minimum(ahead, LOOK_AHEAD * wheelbase) / wheelbase
    for curve in CURVES:
        yaw = pose[2] + curve * turning
        middle = yaw[:-1] + 0.5 * np.diff(yaw)
        step = direction * spacing * np.column_stack([np.cos(middle), np.sin(middle)])
        places = pose[:2] + np.vstack([np.zeros(2), np.cumsum(step, axis=0)])
        yield np.column_stack([places, yaw])


def _spacing(prediction: PathPrediction) -> float:
    steps = np.diff(prediction.distance)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if steps.size else 0.02


def _refuse(
    rover: Rover,
    prediction: PathPrediction,
    verdict: Verdict,
    stop: int,
    end: int,
    ways: str,
) -> Verdict:
    drop = prediction.wheel_drop[stop:end].max(initial=0.0)
    fell = drop > DROP * rover.wheel.radius
    what = f"a wheel drops {drop:.3f} m" if fell else "from here the rover goes in but not out"
    reason = f"trapped: {what}; no way on: {ways}"
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    codes[stop], reasons[stop] = "trapped", reason
    return replace(
        verdict,
        traversable=False,
        codes=tuple(codes),
        reasons=tuple(reasons),
        first_failure=stop,
        code="trapped",
        reason=reason,
    )
