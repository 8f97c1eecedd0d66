"""The main call of the package: a path in, the prediction and the verdict out."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.names import EQUAL
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_in_full
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import judge_bounds
from rover_physics.traversability.entrapment import ask_for_ways_out
from rover_physics.traversability.verdict import (
    MARGIN_CODES,
    Verdict,
    forgive,
    judge,
    name_margin,
)

Judged = tuple[PathPrediction, Verdict]
"""A prediction and the verdict on it."""


def judge_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> tuple[PathPrediction, Verdict]:
    """Predict a path and judge it, including entrapment.

    If the terrain has a layer `elevation_std`, the prediction has bounds, and the verdict also
    refuses waypoints that break a limit in the worst case within them. The layer adds refusals and
    removes none.

    With a control margin, policy "optimal" also refuses waypoints that leave less than that of
    friction or torque, except those that are passable with equal torques.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad] of base_link, map frame.
        options: As for `sweep_path`.
        sigmas: Number of standard deviations by which the map's heights may be wrong; 0 or None
            takes the map as exact.

    Returns:
        The prediction, and the verdict on it.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An option that this rover cannot have, or `sigmas` below 0.
        SoilError: A soil that is not a preset.
    """
    return judge_paths(rover, terrain, [poses], options, sigmas=sigmas)[0]


@quiet
def judge_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, faster than one by one; see `judge_path`."""

    def judge_with(paths: Sequence[ArrayLike], options: SweepOptions) -> list[Judged]:
        return _judge_under_policy(rover, terrain, paths, options, sigmas)

    judged = judge_with(paths, options)
    if options.kept_margin == 0.0:
        return judged
    return [_weigh_margin(one, options, judge_with) for one in judged]


def _weigh_margin(
    judged: Judged,
    options: SweepOptions,
    judge_with: Callable[[Sequence[ArrayLike], SweepOptions], list[Judged]],
) -> Judged:
    """Return the verdict without refusals of what equal torques pass, and name the margin.

    A waypoint that breaks its limits only less the margin may be refused as a lifting wheel,
    because no torques were found; the reason is the margin nevertheless.
    """
    prediction, verdict = judged
    if verdict.traversable:
        return judged
    paths = [prediction.poses]
    verdict = forgive(verdict, judge_with(paths, replace(options, policy=EQUAL))[0][1])
    if not set(verdict.codes) <= {"", *MARGIN_CODES}:
        physical = judge_with(paths, replace(options, control_margin=0.0))[0][1]
        verdict = name_margin(verdict, physical, options.control_margin)
    return prediction, verdict


def _judge_under_policy(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions,
    sigmas: float | None,
) -> list[Judged]:
    """Judge several paths under the policy of the options."""
    check_sigmas(sigmas)
    judged = []
    for swept in sweep_in_full(rover, terrain, paths, options):
        check_interruption()
        prediction = swept.prediction
        verdict = judge(rover, prediction)
        if verdict.code != "wheel_drop":
            verdict = ask_for_ways_out(rover, terrain, swept, verdict, options)
        bounds = bound_path(rover, terrain, prediction, options, sigmas)
        if bounds is not None:
            verdict = judge_bounds(rover, prediction, bounds, verdict)
            prediction = replace(prediction, bounds=bounds)
        judged.append((prediction, verdict))
    return judged
