# SPDX-License-Identifier: Apache-2.0
"""The model at two poses with measured steering angles, as a simulated rover needs it."""

from typing import Any

import numpy as np

from rover_physics.contact.contact_record import hold_wheels
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.crossing import find_crossings
from rover_physics.prediction.evaluation import (
    AHEAD,
    NONE_HELD,
    evaluate_pose,
    new_work,
    set_pose,
)
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.sweep import check_poses, make_prediction, wheels_of
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import forget_uncomputable, new_results
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain


@quiet
def predict_steered(
    rover: Rover,
    terrain: Terrain,
    poses: np.ndarray,
    course: tuple[np.ndarray, np.ndarray],
    options: SweepOptions = DEFAULT_OPTIONS,
) -> PathPrediction:
    """Predict the rover at the poses of a short way with given steering angles.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link, map frame.
        course: Motion (3,) of base_link on the way, vx, vy [m/s] and yaw rate [rad/s], body frame;
            and steering angles (6,) of the wheels [rad], which need not fit the motion.
        options: As for `judge_path`.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    model, places = pack_model(rover, terrain, options), check_poses(poses)
    evaluate = _Evaluator(model, *course)
    results = evaluate(places)
    crossings = find_crossings(terrain, wheels_of(model), places, results, evaluate)
    return make_prediction(model, places, results, crossings)[0].prediction


class _Evaluator:
    """Evaluates a model at poses, as `find_crossings` takes it, with one motion and steering."""

    def __init__(self, model: PackedModel, motion: np.ndarray, steering: np.ndarray):
        self._record, self._work = model.record, new_work()
        self._motion, self._steering = motion, steering

    def __call__(
        self, poses: np.ndarray, held: np.ndarray = NONE_HELD, motions: np.ndarray = AHEAD
    ) -> Any:
        del motions  # all are that of the way
        work, results = self._work, new_results(len(poses))
        moved = np.repeat(self._motion[None], len(poses), axis=0)
        for i in range(len(poses)):
            set_pose(self._record, poses, moved, i, work)
            work.placement.steering[:] = self._steering
            work.can_follow = True
            hold_wheels(held, i, work.contacts)
            evaluate_pose(self._record, work, results[i])
        forget_uncomputable(results)
        return results
