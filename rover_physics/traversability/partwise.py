# SPDX-License-Identifier: Apache-2.0
"""Judgement of long paths in parts: predictions are handed over and not kept."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, check_sigmas
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import check_curvature
from rover_physics.prediction.sweep import PART, check_poses, predict_in_parts
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.entrapment import Course, find_irreversible, refuse_if_trapped
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
        self._model, self._sigmas = pack_model(rover, terrain, options), sigmas
        self._poses = check_poses(poses)
        self._bends = None if curvature is None else check_curvature(curvature, len(self._poses))
        self._courses: list[Course] = []
        """Of each part."""
        self._codes: list[str] = []
        self._reasons: list[str] = []
        self._failure = (-1, "", "")
        """First failure of the prediction itself, whatever its bounds: waypoint, code, reason."""
        self._verdict: Verdict | None = None
        """The verdict on the last part, with the extremes of all parts so far."""

    def parts(self) -> Iterator[PathPrediction]:
        """Yield the predictions of consecutive waypoints, with bounds, without what is between."""
        judged = self._judge_path() if self._bends is None else self._judge_poses(self._bends)
        for prediction, verdict in judged:
            self._codes += verdict.codes
            self._reasons += verdict.reasons
            worst = worst_of(self._verdict or verdict, verdict)
            self._verdict = replace(worst, codes=(), reasons=())
            yield prediction

    @quiet
    def verdict(self) -> Verdict:
        """Return the verdict on all waypoints."""
        assert self._verdict is not None
        verdict = with_refusals(self._verdict, self._codes, self._reasons)
        waypoint, code, reason = self._failure
        if self._bends is not None or code == "wheel_drop":
            return verdict
        course = Course(
            self._poses,
            np.concatenate([one.distance for one in self._courses]),
            np.concatenate([one.irreversible for one in self._courses]),
            np.concatenate([one.drop for one in self._courses]),
            None,
        )
        nominal = replace(verdict, first_failure=waypoint, code=code, reason=reason)
        asked = refuse_if_trapped(self._model, course, nominal)
        return verdict if asked is nominal else asked

    def _judge_path(self) -> Iterator[tuple[PathPrediction, Verdict]]:
        model = self._model
        for part in predict_in_parts(model, self._poses):
            verdict = hold_against_limits(model.rover, part.prediction)
            irreversible, new = (
                find_irreversible(model, part.prediction),
                slice(part.context, None),
            )
            if self._failure[0] < 0 <= verdict.first_failure:
                waypoint = part.first - part.context + verdict.first_failure
                self._failure = (waypoint, verdict.code, verdict.reason)
            prediction = part.prediction.select(new)
            drop = prediction.wheel_drop.max(axis=1)
            self._courses.append(
                Course(prediction.poses, prediction.distance.copy(), irreversible[new], drop, None)
            )
            verdict = with_refusals(verdict, verdict.codes[new], verdict.reasons[new])
            yield add_bounds(model, prediction, verdict, self._sigmas)

    def _judge_poses(self, bends: np.ndarray) -> Iterator[tuple[PathPrediction, Verdict]]:
        model = self._model
        for first in range(0, len(self._poses), PART):
            check_interruption()
            part = slice(first, first + PART)
            yield judge_poses(
                model.rover,
                model.terrain,
                self._poses[part],
                bends[part],
                model.options,
                sigmas=self._sigmas,
            )
