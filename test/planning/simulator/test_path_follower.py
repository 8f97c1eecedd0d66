# SPDX-License-Identifier: Apache-2.0
"""Tests of path following with a rover that moves exactly as commanded."""

import numpy as np
import pytest

from rover_planner.simulator.path_follower import PathFollower


def follow(path, start, speed=0.05, step=0.2, most=4000):
    """Return the poses (n, 3) of a rover that follows a path, and the commands (n, 2)."""
    follower, pose = PathFollower(path, 0.3, 0.5), np.array(start, float)
    poses, commands = [pose.copy()], []
    for _ in range(most):
        v, rate = follower.steer(pose, speed)
        if follower.has_arrived(pose):
            return np.array(poses), np.array(commands)
        pose += step * np.array([v * np.cos(pose[2]), v * np.sin(pose[2]), rate])
        poses.append(pose.copy()), commands.append((v, rate))
    raise AssertionError(f"did not arrive; it is at {pose}")


def line(start, end, yaw, count=30):
    return np.column_stack([np.linspace(start, end, count), np.full(count, yaw)])


def test_a_path_driven_backwards_is_followed_backwards_from_beside_it():
    yaw = 2.0
    heading = np.array([np.cos(yaw), np.sin(yaw)])
    aside = 0.1 * np.array([-heading[1], heading[0]])
    poses, commands = follow(line((0.0, 0.0), -2.0 * heading, yaw), [*aside, yaw])
    assert (commands[:-1, 0] < 0.0).all()
    assert np.hypot(*(poses[-1, :2] + 2.0 * heading)) < 0.1
    assert abs(aside @ poses[-1, :2]) < 0.1 * 0.03


def test_a_change_from_forwards_to_backwards_is_driven_to_its_corner():
    there = line((0.0, 0.0), (1.0, 0.0), 0.0)
    angle = np.linspace(0.0, 0.8, 40)[1:]
    back = np.column_stack([1.0 - np.sin(angle), np.cos(angle) - 1.0, angle])  # arc to the right
    path = np.vstack([there, back])
    poses, commands = follow(path, (0.0, 0.0, 0.0))
    gears = np.sign(commands[:, 0])
    assert np.count_nonzero(np.diff(gears)) == 1 and gears[0] > 0.0 > gears[-1]
    assert poses[:, 0].max() == pytest.approx(1.0, abs=0.08)
    assert np.hypot(*(poses[-1, :2] - path[-1, :2])) < 0.1
