# SPDX-License-Identifier: Apache-2.0
"""Balance, shared torques and contact angles with turned wheels, against the sweep's model."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.traction.balance import BalanceWriter, MeasuredState
from rover_physics.traction.contact_ekf import Motion, MotionContactEstimator
from rover_physics.traction.layout import LOADS, TRACTIONS
from rover_physics.traction.map_contacts import MapContactFinder
from rover_physics.traction.program import ProgramInputs
from rover_physics.traction.solver import TractionWorkspace, solve_traction
from rover_physics.traversability.judge import judge_path, judge_poses
from support.rough_grounds import fractal, plane, random_poses
from support.rover_geometry import free_balance_matrix
from support.traction_states import state_of

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
CURVATURES = (0.0, 0.5, -0.5, 1.2, -2.5, np.inf, -np.inf)
BOTH = pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)


def curved_poses(rover, seed, curvature, **options):
    """Return settled random poses on rough ground with wheels turned for a curvature."""
    poses = random_poses(seed, 12, 1.5)
    curvatures = np.full(len(poses), curvature / (2.0 if rover is M2020 else 1.0))
    ground = plane(0.15, 0.1, half=5.0) if rover is M2020 else fractal(seed)
    return ground, judge_poses(rover, ground, poses, curvatures, **options)[0]


@BOTH
def test_equal_torques_are_those_of_the_sweep(rover):
    writer, count = BalanceWriter(rover), 0
    for seed, curvature in enumerate(CURVATURES):
        _, prediction = curved_poses(rover, seed, curvature)
        for i in np.flatnonzero(prediction.settled):
            rows = writer.write(state_of(rover, prediction, i), 0.0)
            x = rows.force_unit * rows.pull_equally()
            found = x[LOADS], x[TRACTIONS], rows.lateral_forces(x)
            for values, name in zip(found, ("wheel_loads", "tangential", "lateral"), strict=True):
                right = getattr(prediction, name)[i]
                assert values == pytest.approx(right, abs=1e-8 * rover.weight), (curvature, name)
            count += 1
    assert count > 40


def test_shared_torques_of_turned_wheels_keep_the_balance_and_need_less_friction():
    writer, workspace = BalanceWriter(LSR1), TractionWorkspace()
    inputs = ProgramInputs(np.full(6, 0.8), LSR1.wheel.max_torque, LSR1.wheel.radius)
    better = []
    for seed, curvature in enumerate(CURVATURES):
        _, prediction = curved_poses(LSR1, seed, curvature)
        for i in np.flatnonzero(prediction.settled):
            rows = writer.write(state_of(LSR1, prediction, i), 0.0)
            equal = solve_traction(workspace, rows, inputs, max_programs=0)
            answer = solve_traction(workspace, rows, inputs, max_programs=12)
            assert not answer.fallback
            A, b = free_balance_matrix(LSR1, prediction, i)
            forces = np.concatenate([answer.loads, answer.tractions, answer.lateral])
            assert np.abs(A @ forces / LSR1.weight - b).max() < 1e-6
            better.append(answer.utilisation.max() / equal.utilisation.max())
    assert max(better) < 1.001 and np.median(better) < 0.95


@BOTH
def test_a_push_does_its_work_along_the_way_of_the_wheels(rover):
    writer = BalanceWriter(rover)
    for curvature in (0.0, 0.4, -0.4, np.inf):
        prediction = judge_poses(rover, plane(0.0, 0.0, half=5.0), np.zeros((1, 3)), [curvature])[
            0
        ]
        state = state_of(rover, prediction, 0)
        still, pushed = (writer.write(state, push) for push in (0.0, 6.0))
        more = pushed.force_unit * (pushed.pull_equally() - still.pull_equally())[TRACTIONS]
        assert more @ still.wheel_speeds == pytest.approx(6.0, rel=1e-9)
        assert (more * still.directions > 0.0).all()
        rolling = writer.find_rolling(state)
        assert rolling.directions == pytest.approx(still.directions)
        assert rolling.speeds == pytest.approx(still.wheel_speeds, abs=0.05)


def test_the_rolling_motion_is_that_of_the_curve():
    writer = BalanceWriter(LSR1)
    for curvature in (0.8, -0.8, 1.5):
        prediction = judge_poses(LSR1, plane(0.0, 0.0), np.zeros((1, 3)), [curvature])[0]
        motion = writer.find_rolling(state_of(LSR1, prediction, 0)).motion
        assert motion[2] / motion[0] == pytest.approx(curvature)
        assert motion[1] == pytest.approx(0.0, abs=1e-12)
    spot = judge_poses(LSR1, plane(0.0, 0.0), np.zeros((1, 3)), [np.inf])[0]
    rolling = writer.find_rolling(state_of(LSR1, spot, 0))
    assert rolling.motion[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert rolling.directions.tolist() == [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]


@pytest.mark.parametrize("drift", [0.0, 0.05])
def test_the_map_tells_the_contact_angles_whatever_height_odometry_says(drift):
    errors = []
    for seed, curvature in enumerate(CURVATURES):
        ground, prediction = curved_poses(LSR1, seed, curvature)
        finder = MapContactFinder(LSR1, ground)
        for i in np.flatnonzero(prediction.settled):
            pose = np.array([*prediction.position[i], prediction.poses[i, 2]])
            pose[2] += drift
            directions = np.where(prediction.wheel_speed[i] < 0.0, -1.0, 1.0)
            found = finder.find(state_of(LSR1, prediction, i), pose, 0.0, directions)
            assert found.source == "map"
            errors.append(found.angles - prediction.contact_angle[i])
    assert np.median(np.abs(errors)) < 0.03


@BOTH
def test_motion_tells_the_contact_angles_on_an_arc_across_a_slope(rover):
    ground, radius = plane(0.25, 0.1, half=6.0), 3.0
    yaw = np.linspace(0.0, 1.2, 400)
    path = np.column_stack([radius * np.sin(yaw) - 1.5, radius * (1 - np.cos(yaw)) - 1.0, yaw])
    prediction = judge_path(rover, ground, path)[0]
    duration, rates = 0.1, []
    angles = prediction.rocker_angle, prediction.bogie_angle, prediction.roll, prediction.pitch
    rocker, bogie, roll, pitch = (np.gradient(value, duration, axis=0) for value in angles)
    turn = np.gradient(yaw, duration)
    c, s = np.cos(prediction.roll), np.sin(prediction.roll)
    nose = np.cos(prediction.pitch)
    rates = np.column_stack(
        [roll - np.sin(prediction.pitch) * turn, c * pitch + s * nose * turn,
         -s * pitch + c * nose * turn]
    )  # fmt: skip
    speeds = np.linalg.norm(np.gradient(prediction.wheel_centres, duration, axis=0), axis=2)
    estimator, found = MotionContactEstimator(rover), []
    for i in range(len(path)):
        steering = prediction.steering_angle[i]
        # A link's rate about the axle; wheel joints turn relative to it.
        about_axle = rates[i, 1] * np.cos(steering) - rates[i, 0] * np.sin(steering)
        motion = Motion(
            [prediction.roll[i], prediction.pitch[i]],
            [prediction.rocker_angle[i, 0], *prediction.bogie_angle[i]], [rocker[i, 0], *bogie[i]],
            speeds[i] / rover.wheel.radius - about_axle, rates[i], steering,
        )  # fmt: skip
        found.append(estimator.update(motion, duration).angles)
    errors = np.abs(np.array(found) - prediction.contact_angle)[100:-1]
    assert errors.max() < 0.05


def test_straight_wheels_have_the_same_balance_whether_they_steer_or_not():
    fixed = replace(LSR1, steering=None)
    state = MeasuredState(0.1, -0.2, 0.05, np.array([0.1, -0.1]), np.linspace(-0.3, 0.3, 6))
    one, other = (BalanceWriter(rover).write(state, 3.0, 2.0) for rover in (LSR1, fixed))
    assert one.packed.tobytes() == other.packed.tobytes()
