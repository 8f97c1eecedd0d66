"""Traversability classes of many single poses, as numbers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import SIGMAS
from rover_physics.names import CONTROL_POLICIES, EQUAL, OPTIMAL, SERVO, TORQUE_POLICIES
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.threads import CALLS_IN_WORK, limit_threads, run_in_turn
from rover_physics.prediction.evaluation import AHEAD, CHUNK, MODEL, effort, new_works
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import check_poses, sweep_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.first_failure import SuspectLimits, suspect_limits_of
from rover_physics.traversability.judge_poses import judge_poses
from rover_physics.traversability.limit_checks import check_limits
from rover_planner.planning.navigation.class_kernels import (
    DOUBTFUL,
    IMPASSABLE,
    PASSABLE,
    UNKNOWN,
    WITH_SPEED_SERVOS,
    WITH_TRACTION_CONTROL,
    classify_all,
)

PART = 256
"""Number of poses that a thread takes at a time, some 3 ms of work on most ground; before each
part an interruption is possible."""
DOUBT = 1e-6
"""Distance from a limit, in its unit, within which `judge_poses` decides; rounding and the
tolerance of the checks are far below it."""

_CLASS_OF = {EQUAL: PASSABLE, SERVO: WITH_SPEED_SERVOS, OPTIMAL: WITH_TRACTION_CONTROL}
_UNKNOWN_STATUS = (PoseStatus.OFF_MAP, PoseStatus.UNKNOWN_GROUND)
_UNKNOWN_CODES = ("off_map", "unknown_ground")
_HOPELESS_STATUS = (*_UNKNOWN_STATUS, PoseStatus.NOT_SETTLED, PoseStatus.STEERING)
_HOPELESS_CODES = ("suspension", "tilt", "tip_over", "belly")
"""What fails under every policy, because no force has a part in it."""


@dataclass(frozen=True, eq=False)
class RoverOnMap:
    """A rover on a map, and how it is judged."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The map."""
    options: SweepOptions
    """Options of the model; their policy is ignored."""
    sigmas: float = SIGMAS
    """Standard deviations to allow for on an uncertain map."""

    @property
    def is_uncertain(self) -> bool:
        """Whether heights may be wrong."""
        return bool(self.sigmas) and self.terrain.elevation_std is not None


def classify_poses(on_map: RoverOnMap, poses: NDArray[np.float64]) -> NDArray[np.int8]:
    """Return the class (n,) of single poses (n, 3) x, y [m] and yaw [rad], driving straight ahead.

    The class is that of `classify_judged` for the same pose, or UNKNOWN off the map and over
    unknown ground.

    Raises:
        ModelError, SoilError: As `judge_poses`.
    """
    if not len(poses):
        return np.empty(0, np.int8)
    classes = np.full(len(poses), DOUBTFUL, np.int8)
    if not on_map.is_uncertain:
        _find_classes(on_map, check_poses(poses), classes)  # it makes them contiguous
    doubtful = np.flatnonzero(classes == DOUBTFUL)
    for first in range(0, len(doubtful), PART):
        rows = doubtful[first : first + PART]
        classes[rows] = judge_classes(on_map, poses[rows])
    return classes


def _find_classes(
    on_map: RoverOnMap, poses: NDArray[np.float64], classes: NDArray[np.int8]
) -> None:
    """Write the classes (n,) of poses (n, 3) on a map with exact heights, DOUBTFUL near limits."""
    packed = [
        pack_model(on_map.rover, on_map.terrain, replace(on_map.options, policy=policy))
        for policy in TORQUE_POLICIES
    ]
    models = np.array([model.record for model in packed], MODEL)
    kept = tuple(suspect_limits_of(on_map.rover, model) for model in packed)
    broken = tuple(_widen(limits) for limits in kept)

    def parts(works: NDArray[np.void]) -> Iterator[Callable[[], None]]:
        for k, first in enumerate(range(0, len(poses), PART)):
            check_interruption()
            part, own = slice(first, first + PART), k % len(works)
            places = poses[part], AHEAD, kept, broken
            yield partial(classify_all, models, places, works[own : own + 1], classes[part])

    with limit_threads(effort(packed[0].settings, len(poses))) as threads:
        run_in_turn(parts(new_works(threads, CHUNK * CALLS_IN_WORK * threads)), threads)


def _widen(limits: SuspectLimits) -> SuspectLimits:
    """Return limits beyond which a value breaks the given ones for sure."""
    low = ("least_rocker", "least_bogie", "tip_over_ratio", "belly_clearance", "speed_share")
    return SuspectLimits(
        *(
            value - DOUBT if name in low else value + DOUBT
            for name, value in limits._asdict().items()
        )
    )


def judge_classes(on_map: RoverOnMap, poses: NDArray[np.float64]) -> NDArray[np.int8]:
    """Return the classes (n,) of poses (n, 3) as `judge_poses` judges them, n >= 1.

    Raises:
        PoseError, ModelError, SoilError: As `judge_poses`.
    """
    classes = np.full(len(poses), IMPASSABLE, np.int8)
    rows = np.arange(len(poses))
    for policy in CONTROL_POLICIES if on_map.is_uncertain else TORQUE_POLICIES:
        check_interruption()
        judge = _judge_bounded if on_map.is_uncertain else _judge
        broken, unknown, hopeless = judge(on_map, poses[rows], policy)
        classes[rows[~broken]] = _CLASS_OF[policy]
        classes[rows[unknown]] = UNKNOWN
        rows = rows[broken & ~hopeless]
        if not len(rows):
            break
    return classes


Judged = tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]
"""(n,) Whether a pose breaks a limit, is over unknown ground, and fails under every policy."""


def _judge(on_map: RoverOnMap, poses: NDArray[np.float64], policy: str) -> Judged:
    options = replace(on_map.options, policy=policy)
    ahead = np.zeros(len(poses))
    prediction = sweep_poses(on_map.rover, on_map.terrain, poses, ahead, options)
    broken, hopeless = _find_broken(on_map.rover, prediction)
    return broken, np.isin(prediction.status, _UNKNOWN_STATUS), hopeless


def _find_broken(
    rover: Rover, prediction: PathPrediction
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return (n,) which poses break a limit, and which do so under every policy."""
    broken = np.asarray(prediction.status != PoseStatus.SETTLED)
    hopeless = np.isin(prediction.status, _HOPELESS_STATUS)
    for check in check_limits(rover, prediction):
        if check.breaks:
            here = check.broken() & prediction.settled
            broken = broken | here
            if check.code in _HOPELESS_CODES:
                hopeless = hopeless | here
    return broken, hopeless


def _judge_bounded(on_map: RoverOnMap, poses: NDArray[np.float64], policy: str) -> Judged:
    """Judge poses on a map whose heights may be wrong; the bounds take most of the time."""
    options = replace(on_map.options, policy=policy)
    ahead = np.zeros(len(poses))
    _, verdict = judge_poses(
        on_map.rover, on_map.terrain, poses, ahead, options, sigmas=on_map.sigmas
    )
    codes = np.array(verdict.codes)
    unknown = np.isin(codes, _UNKNOWN_CODES)
    return codes != "", unknown, unknown
