"""The compiled loop that finds the classes of single poses: it settles each pose once only."""

from rover_physics.numerics.kernels import kernel
from rover_physics.prediction.evaluation import evaluate_stance, set_pose, stand
from rover_physics.status import PoseStatus, TorquePolicy
from rover_physics.traversability.first_failure import has_grip, stands_safely

UNKNOWN, PASSABLE, WITH_SPEED_SERVOS, WITH_TRACTION_CONTROL, IMPASSABLE = -1, 0, 1, 2, 3
"""Classes, apart from UNKNOWN those of `rover_physics.traversability.classification`."""
DOUBTFUL = -2
"""Class of a pose that is so near a limit that the tolerance of the checks decides."""


@kernel
def classify_all(models, places, works, classes):
    """Find the classes of poses.

    Args:
        models: (k,) MODELs of one rover on one ground; model i has the policy of class i.
        places: (n, 3) x, y [m] and yaw [rad] of the body origin, map frame; their motions, as for
            `evaluate`; for each model the SuspectLimits that surely keep, and that surely break.
        works: (1,) WORK.
        classes: (n,) written.
    """
    (poses, motions, kept, broken), work = places, works[0]
    for i in range(poses.shape[0]):
        set_pose(models[0], poses, motions, i, work)
        classes[i] = _find_class(models, kept, broken, work)


@kernel
def _find_class(models, kept, broken, work):
    """Return the class of the pose in the work space.

    What fails without a part of the forces fails under every policy.
    """
    status, result = stand(models[0], work), work.result
    if status == PoseStatus.OFF_MAP or status == PoseStatus.UNKNOWN_GROUND:
        return UNKNOWN
    if status != PoseStatus.SETTLED:
        return IMPASSABLE
    for k in range(models.size):
        evaluate_stance(models[k], work, status, result)
        if result.status != PoseStatus.SETTLED:
            continue
        if stands_safely(result, kept[k]):
            if has_grip(result, kept[k]):
                return k
        elif not stands_safely(result, broken[k]):
            return IMPASSABLE
        if not _loses_grip(models[k], result, broken[k]):
            return DOUBTFUL
    return IMPASSABLE


@kernel
def _loses_grip(model, result, limits):
    """Return whether a limit of load, sinkage, friction, torque or speed is surely broken."""
    if model.settings.policy == TorquePolicy.SERVO:
        return result.speed_share < limits.speed_share
    return not has_grip(result, limits)
