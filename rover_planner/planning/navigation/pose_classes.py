"""Traversability classes of many single poses, as numbers."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import SIGMAS
from rover_physics.names import CONTROL_POLICIES, EQUAL, OPTIMAL, SERVO, TORQUE_POLICIES
from rover_physics.numerics.interruption import check_interruption
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_poses import judge_poses
from rover_physics.traversability.limit_checks import check_limits

UNKNOWN, PASSABLE, WITH_SPEED_SERVOS, WITH_TRACTION_CONTROL, IMPASSABLE = -1, 0, 1, 2, 3
"""Classes, apart from UNKNOWN those of `rover_physics.traversability.classification`."""
PART = 8192
"""Number of poses that are evaluated at a time."""

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
    parts = [
        _classify(on_map, poses[first : first + PART]) for first in range(0, len(poses), PART)
    ]
    return np.concatenate(parts) if parts else np.empty(0, np.int8)


def _classify(on_map: RoverOnMap, poses: NDArray[np.float64]) -> NDArray[np.int8]:
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
