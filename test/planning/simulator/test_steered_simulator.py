# SPDX-License-Identifier: Apache-2.0
"""Simulated rovers steer: along curves, on the spot, at the rate of their joints."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import load_rover
from rover_physics.names import STEERING_JOINTS
from rover_planner.simulator.mujoco_plant import MujocoPlant
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.simulator.second_try import SecondTry
from support.rough_grounds import plane

LSR1 = load_rover("lsr1")
FIXED = replace(LSR1, steering=None)
STEP, SPEED, LOOK_AHEAD = 0.02, 0.06, 0.4
REACH = float(np.hypot(0.4, 0.31))
ENGINES = pytest.mark.parametrize("engine", [QuasiStaticPlant, MujocoPlant])


def arc(radius, angle):
    turned = np.linspace(0.0, angle, 100)
    x, y = radius * np.sin(turned), radius * (1.0 - np.cos(turned))
    return np.column_stack([x, y, turned])


def turn_and_go(angle, length):
    turned = np.linspace(0.0, angle, 40)
    way = np.linspace(0.0, length, 40)[1:]
    spot = np.column_stack([0.0 * turned, 0.0 * turned, turned])
    straight = np.column_stack([way * np.cos(angle), way * np.sin(angle), np.full(39, angle)])
    return np.vstack([spot, straight])


def follow(plant, path):
    """Follow a path; return the largest distance from it [m], and all poses and states."""
    follower, poses, states = PathFollower(path, LOOK_AHEAD, REACH), [], []
    while not follower.has_arrived(plant.pose()):
        plant.drive(*follower.steer(plant.pose(), SPEED), STEP)
        poses.append(plant.pose())
        states.append(plant.state())
        assert len(poses) < 3000 and not states[-1].stopped
    away = [np.hypot(*(path[:, :2] - pose[:2]).T).min() for pose in poses]
    return max(away), np.array(poses), states


@pytest.mark.parametrize(("engine", "side"), [(QuasiStaticPlant, 1.0), (MujocoPlant, -1.0)])
def test_a_curve_is_driven_with_its_wheels_turned(engine, side):
    plant = engine(LSR1, plane(0.0, 0.0, half=3.0), (0.0, 0.0, 0.0))
    path = arc(side * 1.2, side * 0.6)
    away, poses, states = follow(plant, path)
    assert away < 0.02
    assert poses[-1][:2] == pytest.approx(path[-1, :2], abs=0.25 * LOOK_AHEAD + 0.01)
    angles = [state.joint_positions for state in states]
    inner = np.arctan2(0.4, 1.2 - 0.31)
    front = "front_left_steering" if side > 0.0 else "front_right_steering"
    assert side * np.median([at[front] for at in angles]) == pytest.approx(inner, abs=0.03)
    for at in angles:
        assert at[front] == pytest.approx(-at[front.replace("front", "rear")], abs=0.02)


def test_a_turn_on_the_spot_stays_there_and_the_drive_goes_on():
    plant = QuasiStaticPlant(LSR1, plane(0.0, 0.0, half=3.0), (0.0, 0.0, 0.0))
    away, poses, _ = follow(plant, turn_and_go(0.8, 0.2))
    assert away < 0.03
    turning = poses[poses[:, 2] < 0.6]
    assert np.abs(turning[:, :2]).max() < 0.02
    assert poses[-1][2] == pytest.approx(0.8, abs=0.03)


@ENGINES
def test_a_curve_beyond_the_limit_stops_the_rover_with_the_wheel(engine):
    narrow = replace(LSR1, steering=replace(LSR1.steering, limit=0.4))
    plant = engine(narrow, plane(0.0, 0.0, half=3.0), (0.0, 0.0, 0.0))
    for _ in range(20):
        plant.drive(0.0, 0.1, STEP)
    assert "wheel needs a steering angle of" in plant.state().stopped
    for _ in range(50):
        plant.drive(SPEED, 0.0, STEP)
    assert not plant.state().stopped and plant.pose()[0] > 0.02


@ENGINES
def test_fixed_wheels_have_no_steering_joints_and_skid_in_curves(engine):
    plant = engine(FIXED, plane(0.0, 0.0, half=3.0), (0.0, 0.0, 0.0))
    for _ in range(200):
        plant.drive(SPEED, SPEED, STEP)
    state = plant.state()
    assert not set(STEERING_JOINTS) & set(state.joint_positions)
    assert plant.pose()[2] > 0.05
    right, left = (state.joint_velocities[f"middle_{side}_wheel"] for side in ("right", "left"))
    assert right > 1.5 * left


def test_a_turn_by_more_than_half_a_circle_goes_the_way_of_the_path():
    turned = np.linspace(0.0, 4.0, 60)
    path = np.column_stack([0.0 * turned, 0.0 * turned, np.mod(turned + np.pi, 2 * np.pi) - np.pi])
    follower, pose, total = PathFollower(path, LOOK_AHEAD, REACH), np.zeros(3), 0.0
    for _ in range(2000):
        speed, yaw_rate = follower.steer(pose, SPEED)
        if follower.has_arrived(pose):
            break
        assert speed == 0.0 and yaw_rate > 0.0
        total += 0.1 * yaw_rate
        pose[2] = np.mod(pose[2] + 0.1 * yaw_rate + np.pi, 2 * np.pi) - np.pi
    assert total == pytest.approx(4.0, abs=0.02)


def test_a_rover_that_stands_while_it_steers_is_given_its_time():
    path = PathFollower(turn_and_go(0.5, 1.0), LOOK_AHEAD, REACH)
    follower = SecondTry(path, patience=30.0)
    for step in range(299):
        assert follower.steer(np.zeros(3), SPEED, 0.1 * step) != (-SPEED, 0.0)
    assert not follower.retries
    for step in range(299, 310):
        follower.steer(np.zeros(3), SPEED, 0.1 * step)
    assert follower.retries == 1
