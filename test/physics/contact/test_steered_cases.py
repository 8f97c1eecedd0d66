"""Settling with turned wheels, against MuJoCo: places, attitudes and forces."""

import numpy as np

from rover_physics.prediction.evaluation import evaluate_pose, new_results, new_work, set_pose
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from support.reference_cases import angle_errors, steered_predictions
from support.rover_geometry import wheel_gaps

LSR1 = load_rover("lsr1")


def test_there_are_21_cases_with_turned_wheels_and_all_settle():
    cases = steered_predictions()
    assert sum(len(case.poses) for case, _ in cases) == 21
    assert all(prediction.settled.all() for _, prediction in cases)


def test_the_wheels_are_turned_as_the_arc_asks():
    for case, prediction in steered_predictions():
        np.testing.assert_allclose(prediction.steering_angle, case.steering, atol=1e-12)


def test_centres_of_turned_wheels_are_where_mujoco_has_them():
    errors = np.concatenate(
        [
            np.linalg.norm(prediction.wheel_centres - case.wheel_centres, axis=2).ravel()
            for case, prediction in steered_predictions()
        ]
    )
    assert np.median(errors) <= 0.5e-3
    assert np.percentile(errors, 95) <= 2.5e-3


def test_attitudes_and_suspension_angles_with_turned_wheels_are_those_of_mujoco():
    errors = angle_errors(steered_predictions())
    assert np.median(errors) <= 0.5e-3
    assert np.percentile(errors, 95) <= 5e-3


def test_turned_wheels_touch_by_an_independent_dense_look():
    gaps = np.concatenate(
        [
            wheel_gaps(LSR1, case.terrain, prediction, i)
            for case, prediction in steered_predictions()
            for i in range(len(prediction.poses))
        ]
    )
    assert (np.abs(gaps) <= 1e-4).mean() >= 0.98
    assert np.abs(gaps).max() <= 1e-3


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
