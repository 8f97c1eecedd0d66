"""Judgement of long paths in parts: predictions are handed over and not kept."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.parts import Part, sweep_in_parts
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import judge_bounds
from rover_physics.traversability.entrapment import (
    Course,
    ask_for_ways_out,
    find_one_way,
    policies_of_ways,
)
from rover_physics.traversability.judge_path import weigh_margin
from rover_physics.traversability.verdict import (
    Verdict,
    judge,
    with_refusals,
    worst_of,
)

Take = Callable[[PathPrediction], object]
"""Function that takes the predictions of consecutive waypoints, part by part."""


@quiet
def judge_long_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    take: Take,
) -> Verdict:
    """Judge a path as `judge_path` does, without keeping its prediction.

    The memory is that of a part of the path and of about 100 bytes for each waypoint.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad] of base_link, map frame.
        options: As for `sweep_path`.
        sigmas: As for `judge_path`.
        take: Called with the prediction of the first waypoints, then of the next ones, and so on.
            Their bounds are included, but not the poses in between.

    Returns:
        The verdict of `judge_path`.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    check_sigmas(sigmas)
    path = check_poses(poses)

    def judge_others(rows: Sequence[int], others: SweepOptions) -> list[Verdict]:
        return [_judge_in_parts(rover, terrain, path, others, sigmas) for _ in rows]

    verdict = _judge_in_parts(rover, terrain, path, options, sigmas, take)
    if options.kept_margin == 0.0 or verdict.traversable:
        return verdict
    return weigh_margin([verdict], options, judge_others)[0]


def _judge_in_parts(
    rover: Rover,
    terrain: Terrain,
    path: np.ndarray,
    options: SweepOptions,
    sigmas: float | None,
    take: Take | None = None,
) -> Verdict:
    """Judge a path under the policy of the options."""
    found = _Findings()
    for part in sweep_in_parts(rover, terrain, path, options):
        verdict = judge(rover, part.prediction)
        found.add_course(part, verdict, find_one_way(rover, part.prediction, options))
        prediction = part.prediction.select(slice(part.context, None))
        verdict = with_refusals(
            verdict, verdict.codes[part.context :], verdict.reasons[part.context :]
        )
        bounds = bound_path(rover, terrain, prediction, options, sigmas)
        if bounds is not None:
            verdict = judge_bounds(rover, prediction, bounds, verdict)
            prediction = replace(prediction, bounds=bounds)
        found.add_verdict(verdict)
        if take is not None:
            take(prediction)
    return _check_ways_out(rover, terrain, path, found, options)


@dataclass
class _Findings:
    """What is kept of the parts of a path."""

    codes: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    distance: list[np.ndarray] = field(default_factory=list)
    one_way: list[np.ndarray] = field(default_factory=list)
    drop: list[np.ndarray] = field(default_factory=list)
    failure: tuple[int, str, str] = (-1, "", "")
    """First failure of the prediction itself, whatever its bounds: waypoint, code and reason."""
    verdict: Verdict | None = None
    """The verdict on the last part, with the extremes of all parts so far."""

    def add_course(self, part: Part, verdict: Verdict, one_way: np.ndarray) -> None:
        """Take a part, the verdict on it and where its way back has to be judged."""
        new = slice(part.context, None)
        self.distance.append(part.prediction.distance[new].copy())
        self.one_way.append(one_way[new].copy())
        self.drop.append(part.prediction.wheel_drop[new].max(axis=1))
        if self.failure[0] < 0 <= verdict.first_failure:
            waypoint = part.first - part.context + verdict.first_failure
            self.failure = (waypoint, verdict.code, verdict.reason)

    def add_verdict(self, verdict: Verdict) -> None:
        """Take the verdict on the new waypoints of a part."""
        self.codes += verdict.codes
        self.reasons += verdict.reasons
        worst = worst_of(self.verdict or verdict, verdict)
        self.verdict = replace(worst, codes=(), reasons=())


def _check_ways_out(
    rover: Rover, terrain: Terrain, path: np.ndarray, found: _Findings, options: SweepOptions
) -> Verdict:
    """Return the verdict on the whole path, refused as trapped if there is no way out."""
    assert found.verdict is not None
    verdict = with_refusals(found.verdict, found.codes, found.reasons)
    waypoint, code, reason = found.failure
    if code == "wheel_drop":
        return verdict
    course = Course(
        path,
        np.concatenate(found.distance),
        np.concatenate(found.one_way),
        np.concatenate(found.drop),
        lambda waypoints: _judge_back(rover, terrain, path[waypoints][::-1], options),
    )
    nominal = replace(verdict, first_failure=waypoint, code=code, reason=reason)
    asked = ask_for_ways_out(rover, terrain, course, nominal, options)
    if asked is nominal:
        return verdict
    return with_refusals(verdict, asked.codes, asked.reasons)


def _judge_back(
    rover: Rover, terrain: Terrain, poses: np.ndarray, options: SweepOptions
) -> Verdict:
    """Judge the way back over poses up to its first failure, as `judge_path` does."""
    for policy in policies_of_ways(options):
        reverse = replace(options, policy=policy, backward=not options.backward)
        verdict = _judge_to_failure(rover, terrain, poses, reverse)
        if verdict.traversable:
            break
    return verdict


def _judge_to_failure(
    rover: Rover, terrain: Terrain, poses: np.ndarray, options: SweepOptions
) -> Verdict:
    """Return the verdict on the part with the first failure, or on the last part."""
    for part in sweep_in_parts(rover, terrain, poses, options):
        verdict = judge(rover, part.prediction)
        if not verdict.traversable:
            at = part.first - part.context + verdict.first_failure
            return replace(verdict, first_failure=at)
    return verdict
