# SPDX-License-Identifier: Apache-2.0
"""Tests of when a path is over."""

import numpy as np

from rover_planner.planning.navigation.watched_path import WatchedPath

STRAIGHT = np.column_stack([np.linspace(0.0, 3.0, 31), np.zeros(31), np.zeros(31)])
TURN = np.column_stack([np.full(9, 3.0), np.zeros(9), np.linspace(0.0, 2.0, 9)])
BACK = np.column_stack([np.linspace(3.0, 0.0, 31), np.zeros(31), np.zeros(31)])
WITHIN = 0.2


def drive(path: WatchedPath, poses) -> list[bool]:
    """Return for each measured pose whether the path is over."""
    found, index = [], 0
    for pose in np.asarray(poses, float):
        index = path.find_place(pose, index).index
        found.append(path.is_over(pose, index, WITHIN))
    return found


def test_a_straight_path_is_over_near_its_end():
    poses = [(x, 0.04, 0.05) for x in np.arange(0.05, 3.0, 0.1)]
    over = drive(WatchedPath(STRAIGHT), poses)
    assert over == [np.hypot(3.0 - x, y) < WITHIN for x, y, _ in poses]


def test_a_path_that_comes_back_to_its_start_is_not_over_before_it_was_driven():
    path = WatchedPath(np.concatenate([STRAIGHT, BACK[1:]]))
    ways = [*np.arange(0.0, 3.0, 0.1), *np.arange(3.0, -0.05, -0.1)]
    over = drive(path, [(x, 0.0, 0.0) for x in ways])
    assert over[-1] and not any(over[:-3])


def test_a_turn_on_the_spot_at_the_end_is_driven_before_the_path_is_over():
    path = WatchedPath(np.concatenate([STRAIGHT, TURN[1:]]))
    there = [(x, 0.0, 0.0) for x in np.arange(0.0, 3.01, 0.1)]
    turned = [(3.0, 0.0, yaw) for yaw in np.arange(0.0, 2.01, 0.2)]
    over = drive(path, [*there, *turned])
    assert over[-1] and not any(over[: len(there)])
