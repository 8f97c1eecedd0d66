# SPDX-License-Identifier: Apache-2.0
"""Judgement of long paths in parts: predictions are handed over and not kept."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, check_sigmas
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.parts import PART, Part, predict_in_parts
from rover_physics.prediction.path_motion import check_curvature
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.entrapment import (
    Course,
    find_one_way,
    refuse_if_trapped,
)
from rover_physics.traversability.judge import add_bounds, judge_poses
from rover_physics.traversability.verdict import (
    Verdict,
    hold_against_limits,
    with_refusals,
    worst_of,
)


class PartwiseJudge:
    """Judges a path as `judge_path`, or single poses as `judge_poses`, part by part.

    The memory is that of a part and of about 100 bytes for each waypoint. First all `parts` are
    taken, then `verdict` is asked.
    """

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        poses: ArrayLike,
        options: SweepOptions = DEFAULT_OPTIONS,
        *,
        curvature: ArrayLike | None = None,
        sigmas: float | None = SIGMAS,
    ):
        """Start nothing yet; arguments and errors as for `judge_path`.

        With a `curvature` (n,), as for `judge_poses`, the poses form no path.
        """
        check_sigmas(sigmas)
        self._rover, self._terrain, self._options = rover, terrain, options
        self._poses, self._sigmas = check_poses(poses), sigmas
        self._bends = None if curvature is None else check_curvature(curvature, len(self._poses))
        self._found = _Findings()

    def parts(self) -> Iterator[PathPrediction]:
        """Yield the predictions of consecutive waypoints, with bounds, without what is between."""
        return self._judge_path() if self._bends is None else self._judge_poses(self._bends)

    @quiet
    def verdict(self) -> Verdict:
        """Return the verdict on all waypoints."""
        found = self._found
        assert found.verdict is not None
        verdict = with_refusals(found.verdict, found.codes, found.reasons)
        waypoint, code, reason = found.failure
        if self._bends is not None or code == "wheel_drop":
            return verdict
        course = Course(
            self._poses,
            np.concatenate(found.distance),
            np.concatenate(found.one_way),
            np.concatenate(found.drop),
            None,
        )
        nominal = replace(verdict, first_failure=waypoint, code=code, reason=reason)
        asked = refuse_if_trapped(self._rover, self._terrain, course, nominal, self._options)
        return verdict if asked is nominal else with_refusals(verdict, asked.codes, asked.reasons)

    def _judge_path(self) -> Iterator[PathPrediction]:
        rover, options = self._rover, self._options
        for part in predict_in_parts(rover, self._terrain, self._poses, options):
            verdict = hold_against_limits(rover, part.prediction)
            one_way = find_one_way(rover, part.prediction, options)
            self._found.add_course(part, verdict, one_way)
            prediction = part.prediction.select(slice(part.context, None))
            verdict = with_refusals(
                verdict, verdict.codes[part.context :], verdict.reasons[part.context :]
            )
            yield self._add(prediction, verdict)

    def _add(self, prediction: PathPrediction, verdict: Verdict) -> PathPrediction:
        """Add the bounds of a part and take its verdict; return it with the bounds."""
        prediction, verdict = add_bounds(
            self._rover, self._terrain, prediction, verdict, self._options, self._sigmas
        )
        self._found.add_verdict(verdict)
        return prediction

    def _judge_poses(self, bends: np.ndarray) -> Iterator[PathPrediction]:
        for first in range(0, len(self._poses), PART):
            check_interruption()
            part = slice(first, first + PART)
            prediction, verdict = judge_poses(
                self._rover,
                self._terrain,
                self._poses[part],
                bends[part],
                self._options,
                sigmas=self._sigmas,
            )
            self._found.add_verdict(verdict)
            yield prediction


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
