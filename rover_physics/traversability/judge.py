# SPDX-License-Identifier: Apache-2.0
"""The main calls of the package: paths or poses in, predictions and verdicts out."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import bound_path, check_sigmas
from rover_physics.chance.failure_chance import check_accepted_chance, find_failure_chance
from rover_physics.limits.table import WHEEL_CONSTRAINTS
from rover_physics.names import EQUAL, OPTIMAL
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_kernels import NO_CROSSINGS
from rover_physics.prediction.path_motion import check_curvature, motions_of
from rover_physics.prediction.sweep import (
    PART,
    SweptPath,
    check_poses,
    predict_in_parts,
    predict_paths,
    predict_poses,
)
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import SIGMAS
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.entrapment import (
    Course,
    course_of,
    refuse_if_trapped,
)
from rover_physics.traversability.verdict import (
    Verdict,
    hold_against_limits,
    refuse_chance,
    refuse_worst_case,
    with_refusals,
    worst_of,
)


def judge_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    stop_at_failure: bool = False,
    accepted_chance: float | None = None,
    chance_of_refused: bool = True,
    known: KnownPoses | None = None,
) -> tuple[PathPrediction, Verdict]:
    """Predict a path and judge it, including entrapment.

    If the terrain has a layer `elevation_std`, the prediction has bounds, and the verdict also
    refuses waypoints that break a limit in the worst case within them. The layer adds refusals and
    removes none.

    With a control margin, policy "optimal" also refuses poses that leave less than that of
    friction or torque, except those that are passable with equal torques.

    Args:
        rover: The rover.
        terrain: The ground; its friction and soil layers override the options.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad] of base_link, map frame, n >= 1.
        options: Torque policy, friction, soil, arm and direction.
        sigmas: Number of standard deviations by which the map's heights may be wrong; 0 or None
            takes the map as exact.
        stop_at_failure: Whether to leave out the waypoints beyond the first failure (default: all
            waypoints are predicted and judged). It saves their time and changes neither whether
            the path is traversable nor code, reason and waypoint of the first failure, unless
            the code is `chance`.
        accepted_chance: Largest chance of failure, 0 to 1, of a path that is traversable; the
            verdict then has the chance, except of a path that stopped at its first failure
            (docs/uncertainty.md); with `stop_at_failure`, one above the accepted chance may be
            larger than told, and most at another waypoint. None does not ask for it.
        chance_of_refused: Whether to ask for it on a path that is refused without it, too.
        known: What this rover with these options has found on this ground so far; grows. It saves
            time and changes nothing else.

    Returns:
        The prediction, and the verdict on it. With `stop_at_failure`, both end at the first
        failure or at a waypoint beyond it, and only the first refusal is sure to be the same as
        without.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An option that this rover cannot have, `sigmas` below 0, or `accepted_chance`
            outside 0 to 1.
        SoilError: A soil that is not a preset.
    """
    return judge_paths(
        rover,
        terrain,
        [poses],
        options,
        sigmas=sigmas,
        stop_at_failure=stop_at_failure,
        accepted_chance=accepted_chance,
        chance_of_refused=chance_of_refused,
        known=known,
    )[0]


@quiet
def judge_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    stop_at_failure: bool = False,
    check_entrapment: bool = True,
    accepted_chance: float | None = None,
    chance_of_refused: bool = True,
    known: KnownPoses | None = None,
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, faster than one by one.

    Args:
        rover: The rover.
        terrain: The ground.
        paths: Poses of each path, (n, 3) x, y [m] and yaw [rad], map frame.
        options: As for `judge_path`.
        sigmas: As for `judge_path`.
        stop_at_failure: As for `judge_path`.
        check_entrapment: False where pieces of a longer path are judged, and the whole of it
            later.
        accepted_chance: As for `judge_path`.
        chance_of_refused: As for `judge_path`.
        known: As for `judge_path`.

    Returns:
        Prediction and verdict of each path, as of `judge_path`.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    allowed = check_sigmas(sigmas)
    check_accepted_chance(accepted_chance)
    model = pack_model(rover, terrain, options).remember(known)
    checked = [check_poses(poses) for poses in paths]
    judged, of_refused = [], chance_of_refused and not stop_at_failure
    paths_swept = predict_paths(model, checked, stop_at_failure)
    for poses, swept in zip(checked, paths_swept, strict=True):
        check_interruption()
        verdict = hold_against_limits(rover, swept.prediction)
        if check_entrapment and verdict.code != "wheel_drop":
            course = course_of(model, poses, swept.prediction, swept)
            verdict = refuse_if_trapped(model, course, verdict)
        prediction, verdict = add_bounds(model, swept.prediction, verdict, allowed)
        if accepted_chance is not None and (verdict.traversable or of_refused):
            enough = accepted_chance if stop_at_failure else 1.0
            chance = find_failure_chance(model, swept, enough=enough)
            verdict = refuse_chance(verdict, chance, accepted_chance)
        judged.append((prediction, verdict))
    return judged


@quiet
def judge_poses(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike | None = None,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    accepted_chance: float | None = None,
) -> tuple[PathPrediction, Verdict]:
    """Predict and judge single poses that form no path; what lies between them is not looked at.

    Crossings, falls, drops and entrapment are left out. Time, energy and distance are 0 where the
    rover settled.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link, map frame, n >= 1.
        curvature: (n,) curvature of the motion of base_link at each pose [1/m], positive to the
            left, 0 straight ahead, inf or -inf on the spot. None: straight ahead.
        options: As for `judge_path`.
        sigmas: As for `judge_path`.
        accepted_chance: As for `judge_path`; the chance that any of the poses fails.

    Returns:
        The prediction, and the verdict on all poses.

    Raises:
        PoseError: Poses or curvatures of wrong shape, or not numbers.
        ModelError, SoilError: As `judge_path`.
    """
    allowed = check_sigmas(sigmas)
    check_accepted_chance(accepted_chance)
    model, places = pack_model(rover, terrain, options), check_poses(poses)
    motions = motions_of(model, places, np.zeros(len(places)) if curvature is None else curvature)
    prediction, verdict = _judge_in_motion(model, places, motions, allowed)
    if accepted_chance is not None:
        swept = SweptPath(prediction, NO_CROSSINGS)
        chance = find_failure_chance(model, swept, on_path=False)
        verdict = refuse_chance(verdict, chance, accepted_chance)
    return prediction, verdict


def _judge_in_motion(
    model: PackedModel, places: np.ndarray, motions: np.ndarray, sigmas: float
) -> tuple[PathPrediction, Verdict]:
    """Judge single poses (n, 3) with motions (n, 3) as of `motions_of`."""
    prediction = predict_poses(model, places, motions)
    return add_bounds(model, prediction, hold_against_limits(model.rover, prediction), sigmas)


def add_bounds(
    model: PackedModel, prediction: PathPrediction, verdict: Verdict, sigmas: float
) -> tuple[PathPrediction, Verdict]:
    """Return a prediction with its bounds and the verdict with their refusals.

    On a map with exact heights both stay as they are.
    """
    bounds = bound_path(model, prediction, sigmas)
    if bounds is None:
        return prediction, verdict
    worst = refuse_worst_case(model.rover, prediction, bounds, verdict)
    if model.options.policy == OPTIMAL:
        worst = _pass_with_equal_torques(model, prediction, verdict, worst)
    return replace(prediction, bounds=bounds), worst


def _pass_with_equal_torques(
    model: PackedModel, prediction: PathPrediction, verdict: Verdict, worst: Verdict
) -> Verdict:
    """Return the worst case without refusals of waypoints that equal torques pass in theirs.

    The bounds are those of one set of torques, and the best torques on the true ground are as good
    as any set. `verdict` is the one without bounds, of which all refusals stay, as do those for
    what the best torques do not better.
    """
    codes, reasons = list(worst.codes), list(worst.reasons)
    added = [i for i, code in enumerate(codes) if code and not verdict.codes[i]]
    rows = [i for i in added if codes[i] in WHEEL_CONSTRAINTS]
    if not rows:
        return worst
    places, motions = prediction.poses[rows], np.ascontiguousarray(prediction.motion[rows])
    _, other = _judge_in_motion(model.change(policy=EQUAL), places, motions, worst.map_sigmas)
    for i, code in zip(rows, other.codes, strict=True):
        if not code:
            codes[i] = reasons[i] = ""
    return with_refusals(worst, codes, reasons)


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
        self._sigmas = check_sigmas(sigmas)
        self._model = pack_model(rover, terrain, options)
        self._poses = check_poses(poses)
        self._bends = None if curvature is None else check_curvature(curvature, len(self._poses))
        self._courses: list[tuple[np.ndarray, ...]] = []
        """Of each part `distance`, `irreversible`, `drop` and `direction` of its Course."""
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
        distance, irreversible, drop, direction = map(
            np.concatenate, zip(*self._courses, strict=True)
        )
        course = Course(self._poses, distance, irreversible, drop, direction, None)
        nominal = replace(verdict, first_failure=waypoint, code=code, reason=reason)
        asked = refuse_if_trapped(self._model, course, nominal)
        return verdict if asked is nominal else asked

    def _judge_path(self) -> Iterator[tuple[PathPrediction, Verdict]]:
        model = self._model
        for part in predict_in_parts(model, self._poses):
            verdict = hold_against_limits(model.rover, part.prediction)
            course = course_of(model, self._poses, part.prediction, None)
            if self._failure[0] < 0 <= verdict.first_failure:
                waypoint = part.start + verdict.first_failure
                self._failure = (waypoint, verdict.code, verdict.reason)
            new = slice(part.context, None)
            prediction = part.prediction.select(new)
            rows = course.distance.copy(), course.irreversible, course.drop, course.direction
            self._courses.append(tuple(row[new] for row in rows))
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
