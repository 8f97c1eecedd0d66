# SPDX-License-Identifier: Apache-2.0
"""Tests of the division of stretches between waypoints."""

import numpy as np

from rover_physics.prediction.crossing import PIECES, Crossings, limits_of
from rover_physics.prediction.path_kernels import Wheels, sort_pieces
from rover_physics.results.record import new_results
from rover_physics.status import PoseStatus

WHEELS = Wheels(0.1, 0.5, 1.0, 1.0, 0.1, False)


def known_stretch(inside: PoseStatus) -> Crossings:
    """Return a stretch in which a wheel stops falling, with poses of a status within it."""
    count = PIECES + 1
    results = new_results(count)
    for name in results.dtype.names:
        results[name] = 0.0
    results["wheel_speed"] = 0.3
    results["contact_angle"][0, 2] = -0.9
    results["contact_angle"][1:, 2] = -0.75
    results["status"][2:] = inside
    places = np.append([0.0, 1.0], np.arange(1, PIECES) / PIECES)
    poses = np.zeros((count, 3))
    poses[:, 0] = 0.02 * places
    return Crossings(places, np.ones(count, np.int64), np.zeros(count, bool), poses, results)


def count_open(inside: PoseStatus) -> int:
    known, ends = known_stretch(inside), np.array([[0, 1]])
    pieces = np.empty((2, PIECES, 2), np.int64)
    return sort_pieces(ends, PIECES, known.points, limits_of(WHEELS), pieces)[0]


def test_the_end_of_a_fall_is_searched_between_poses_that_settle():
    assert count_open(PoseStatus.SETTLED) == 1


def test_a_stretch_in_which_no_pose_settles_is_not_divided_for_ever():
    assert count_open(PoseStatus.NOT_SETTLED) == 0
