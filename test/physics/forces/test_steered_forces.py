# SPDX-License-Identifier: Apache-2.0
"""Forces on turned wheels, against MuJoCo."""

import numpy as np

from rover_physics.prediction.evaluation import evaluate_pose, new_work, set_pose
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.record import new_results
from rover_physics.rover.rover_file import load_rover
from support.reference_cases import steered_predictions

LSR1 = load_rover("lsr1")


def force_errors(own_lateral: bool) -> np.ndarray:
    """Return the errors of the forces on all wheels, over the weight.

    Four lateral forces are not determined by statics. They are the model's, or MuJoCo's.
    """
    errors = []
    for case, prediction in steered_predictions():
        model = pack_model(LSR1, case.terrain, SweepOptions(policy="optimal"))
        motions = motions_of(model, prediction.poses, case.curvature)
        for i in range(len(case.poses)):
            work, result = new_work(), new_results(1)[0]
            set_pose(model.record, prediction.poses, motions, i, work)
            evaluate_pose(model.record, work, result)
            balance, free = work.balance, np.zeros(10)
            free[0] = 1.0
            theirs = np.einsum("wx,wx->w", case.forces[i], balance.frames[:, 2]) / LSR1.weight
            if not own_lateral:
                missing = theirs - balance.lateral[:, 0]
                free[6:] = np.linalg.lstsq(balance.lateral[:, 6:], missing, rcond=None)[0]
            parts = [balance.normal @ free, balance.tangential @ free, balance.lateral @ free]
            size = np.linalg.norm(case.forces[i], axis=1) / LSR1.weight
            errors.append(np.abs(np.linalg.norm(parts, axis=0) - size))
    return np.concatenate(errors)


def test_the_forces_on_turned_wheels_are_those_of_mujoco():
    assert np.median(force_errors(own_lateral=True)) <= 0.005


def test_with_mujocos_lateral_forces_all_other_forces_are_those_of_mujoco():
    """Dry friction keeps the forces with which the wheels of a dropped rover hold one another."""
    errors = force_errors(own_lateral=False)
    assert np.median(errors) <= 0.002
    assert np.percentile(errors, 95) <= 0.015
