# SPDX-License-Identifier: Apache-2.0
"""Contact angles from simulated motion and from the map, over slopes, steps and rocks."""

import numpy as np
import pytest

from rover_physics.errors import ModelError
from rover_physics.traction.balance import MeasuredState
from rover_physics.traction.contact_ekf import MotionContactEstimator
from rover_physics.traction.map_contacts import MapContactFinder
from support.grounds import fractal, plane, raised, rocky
from support.paths import arc_of, poses_at
from support.reference_drives import drive_ground
from support.rover_geometry import turned_round
from support.rovers import LSR1, M2020
from support.traction_states import drive_states, state_of


def follow(rover, motions, duration):
    estimator = MotionContactEstimator(rover)
    estimates = [estimator.update(motion, duration) for motion in motions]
    covariances = np.array([estimate.covariance for estimate in estimates])
    assert np.allclose(covariances, covariances.swapaxes(1, 2), atol=1e-12)
    assert np.linalg.eigvalsh(covariances).min() > 0.0
    assert not np.array_equal(covariances[0], covariances[-1])  # each estimate keeps its own
    angles = np.array([estimate.angles for estimate in estimates])
    deviations = np.sqrt([np.diag(estimate.covariance) for estimate in estimates])
    return angles, deviations


@pytest.mark.parametrize(("rover", "slope"), [(LSR1, (0.1, 0.25)), (M2020, (-0.3, 0.0))])
def test_on_an_even_slope_the_angles_are_known_at_rest_and_in_motion(rover, slope):
    prediction, motions, duration = drive_states(rover, plane(*slope, half=4.0))
    still = motions[0]._replace(wheel_rates=np.zeros(6), body_rates=np.zeros(3))
    estimate = MotionContactEstimator(rover).update(still, 0.02)
    assert estimate.angles == pytest.approx(prediction.contact_angle[0], abs=0.01)
    angles, _ = follow(rover, motions, duration)
    assert np.abs(angles - prediction.contact_angle)[400:].max() < 0.01


@pytest.mark.parametrize(
    ("rover", "ground", "share"),
    [
        (LSR1, drive_ground("slope", 20.0), 0.15),
        (LSR1, drive_ground("step", 0.08), 0.6),
        (turned_round(LSR1), rocky(1), 0.45),
    ],
    ids=["slope", "step", "rocky, backwards"],
)
def test_motion_tells_the_angles_where_zero_is_far_off(rover, ground, share):
    prediction, motions, duration = drive_states(rover, ground)
    angles, deviations = follow(rover, motions, duration)
    truth = prediction.contact_angle[150:]
    errors = angles[150:] - truth
    assert np.linalg.norm(errors) < share * np.linalg.norm(truth)
    assert (np.abs(errors) > 3.0 * deviations[150:]).mean() < 0.02


@pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)
def test_motion_tells_the_contact_angles_on_an_arc_across_a_slope(rover):
    path = arc_of(1.0 / 3.0, np.linspace(0.0, 3.6, 400)) - poses_at(1.5, 1.0)
    prediction, motions, duration = drive_states(rover, plane(0.25, 0.1, half=6.0), path)
    angles, _ = follow(rover, motions, duration)
    assert np.abs(angles - prediction.contact_angle)[100:-1].max() < 0.05


def test_at_rest_nothing_is_learnt_or_forgotten():
    _, motions, duration = drive_states(LSR1, fractal(1))
    estimator = MotionContactEstimator(LSR1)
    for motion in motions[:300]:
        moved = estimator.update(motion, duration)
    still = motions[300]._replace(
        joint_rates=np.zeros(3), wheel_rates=np.zeros(6), body_rates=np.zeros(3)
    )
    rested = estimator.update(still, 100.0)
    assert np.array_equal(rested.angles, moved.angles)
    assert np.array_equal(rested.covariance, moved.covariance)


def test_at_the_foot_of_a_face_it_is_the_face_that_counts():
    ground = drive_ground("step", 0.16)
    pose = np.array([-0.4 - 0.1, 0.0, 0.3, 0.0])
    face = np.arctan2(0.16, 0.04)  # it rises over two cells
    level = MeasuredState(0.0, 0.0, 0.0, np.zeros(2), np.zeros(6))
    finder = MapContactFinder(LSR1, ground)
    angles = finder.find(level, pose, 0.0).angles
    back = finder.find(level, pose, 0.0, directions=-1.0).angles
    assert angles[[2, 5]] == pytest.approx(np.full(2, face), abs=0.02)
    assert angles[[0, 1, 3, 4]] == pytest.approx(np.zeros(4), abs=0.02)
    assert back == pytest.approx(np.zeros(6), abs=0.02)


def test_ground_that_the_map_does_not_have_is_refused_by_wheel():
    half_known = raised(plane(0.0, 0.0, half=2.0), np.s_[:, 55:], np.nan)
    finder = MapContactFinder(LSR1, half_known)
    prediction, _, _ = drive_states(LSR1, plane(0.0, 0.0, half=2.5))
    with pytest.raises(ModelError, match="front_right"):
        finder.find(state_of(LSR1, prediction, 600), np.array([0.0, 0.0, 0.3, 0.0]), 0.0)
