# SPDX-License-Identifier: Apache-2.0
"""Loops over waypoints: jumps are found where they are, and what adds up is the sum."""

import numpy as np
import pytest

from rover_physics.prediction.crossing import divide_stretches
from rover_physics.prediction.path_kernels import (
    Crossings,
    Wheels,
    add_up,
    find_jumps,
    sort_pieces,
)
from rover_physics.results.record import new_results
from rover_physics.status import PoseStatus

WHEELS = Wheels(0.1, 0.5, 1.0, 1.0, 0.1, False)


def results_with(contact_angles, statuses=PoseStatus.SETTLED, heights=0.0):
    """Return results of which the front right wheel has these contact angles and heights."""
    results = new_results(len(contact_angles))
    results["contact_angle"] = results["wheel_centres"] = 0.0
    results["contact_angle"][:, 2] = contact_angles
    results["wheel_centres"][:, 2, 2] = heights
    results["status"] = statuses
    results["motion"] = [0.03, 0.0, 0.0]
    results["steering_angle"] = 0.0
    results["kept_share"] = 1.0
    return results


def along_x(xs):
    poses = np.zeros((len(xs), 3))
    poses[:, 0] = xs
    return poses


def crossings_of(place, waypoint, poses, results):
    return Crossings(place, waypoint, np.zeros(len(place), bool), poses, results).views


def jumps_of(results, spacing=0.02, joined=None):
    n = len(results)
    ends = np.empty((n, 2), np.int64)
    joined = np.ones(n - 1, bool) if joined is None else np.array(joined)
    poses = along_x(spacing * np.arange(n))
    count = find_jumps(results, poses, joined, WHEELS, ends)
    return ends[:count].tolist()


def sorted_pieces(results, xs, pieces=4):
    """Return open and closed pieces of one stretch: its ends, then the rows between them."""
    spare = np.empty((2, pieces, 2), np.int64)
    known = crossings_of(np.empty(0), np.empty(0, np.int64), along_x(xs), results)
    n_open, n_closed = sort_pieces(np.array([[0, 1]]), pieces, known, WHEELS, spare)
    return spare[0, :n_open].tolist(), spare[1, :n_closed].tolist()


def test_a_jump_is_a_steep_contact_that_turns_or_a_wheel_that_rises():
    assert jumps_of(results_with([0.0, 0.5, 0.6, 0.0])) == [[0, 1], [2, 3]]
    assert jumps_of(results_with([0.0, 0.3, 0.0])) == []
    assert jumps_of(results_with([0.0] * 3, heights=[0.0, 0.02, 0.05])) == [[1, 2]]


def searched(angles, friction):
    """Return whether a step is searched whose ends have these contact angles and frictions."""
    results = results_with(angles)
    results["friction_utilisation"] = np.array(friction)[:, None]
    results["torque_saturation"] = 0.0
    return bool(jumps_of(results))


def test_peaks_of_forces_are_looked_for_where_contacts_turn_near_a_limit():
    assert searched([0.0, 0.2], [0.7, 0.8])
    assert searched([0.0, 0.03], [0.92, 0.9])
    assert searched([0.0, 0.2], [0.8, 1.2])
    assert not searched([0.0, 0.01], [0.7, 0.97])
    assert not searched([0.0, 0.2], [0.5, 0.5])
    assert not searched([0.0, 0.2], [1.2, 1.3])


def test_the_place_where_a_wheel_begins_to_fall_is_looked_for():
    assert searched([-0.76, -0.82], [0.2, 0.2])
    assert not searched([-0.72, -0.76], [0.2, 0.2])
    assert not searched([0.76, 0.82], [0.2, 0.2])


def test_no_jump_is_looked_for_where_the_path_is_not_one_way():
    results = results_with([0.0, 0.5, 0.0])
    assert jumps_of(results, joined=[True, False]) == [[0, 1]]
    assert jumps_of(results, spacing=0.0) == [] == jumps_of(results, spacing=0.11)


@pytest.mark.parametrize("status", [PoseStatus.OFF_MAP, PoseStatus.NOT_SETTLED])
def test_there_is_no_jump_to_a_waypoint_without_a_pose(status):
    assert (
        jumps_of(results_with([0.0, 0.5, 0.0], [PoseStatus.SETTLED, status, PoseStatus.SETTLED]))
        == []
    )


def test_stretches_are_divided_evenly_and_turned_the_shorter_way():
    ends, place = np.array([[0, 1]]), np.array([3.0, 4.0])
    poses, results = np.array([[0.0, 0.0, 3.0], [0.4, -0.8, -3.0]]), new_results(2)
    results["motion"] = [[0.03, 0.0, 0.0], [0.02, 0.0, 0.1]]
    known = crossings_of(place, np.array([4, 4]), poses, results)
    new_place, new_waypoint, new_poses, motions = divide_stretches(known, ends)
    assert motions.tolist() == [[0.02, 0.0, 0.1]] * 3
    assert new_place.tolist() == [3.25, 3.5, 3.75] and new_waypoint.tolist() == [4, 4, 4]
    assert new_poses[:, :2] == pytest.approx(np.array([[0.1, -0.2], [0.2, -0.4], [0.3, -0.6]]))
    turn = 2.0 * np.pi - 6.0
    assert new_poses[:, 2] == pytest.approx(3.0 + turn * np.array([0.25, 0.5, 0.75]))


def test_a_piece_is_closed_only_where_it_is_short_or_holds_a_pose_that_does_not_settle():
    angles, xs = [0.0, 0.6, 0.0, 0.6, 0.6], np.array([0.0, 0.02, 0.005, 0.01, 0.015])
    assert sorted_pieces(results_with(angles), xs) == ([[2, 3]], [])
    assert sorted_pieces(results_with(angles), 1e-3 * xs) == ([], [[2, 3]])
    stuck = [
        PoseStatus.SETTLED,
        PoseStatus.SETTLED,
        PoseStatus.SETTLED,
        PoseStatus.NOT_SETTLED,
        PoseStatus.SETTLED,
    ]
    assert sorted_pieces(results_with(angles, stuck), xs) == ([], [[2, 4]])


def open_pieces_of_a_peak(friction):
    """Return how many pieces 1.5 mm long stay open, with this friction and contacts that turn."""
    results = results_with([0.0, 0.8, 0.2, 0.4, 0.6])
    results["contact_angle"] *= 0.5
    results["friction_utilisation"], results["torque_saturation"] = friction, 0.0
    return len(sorted_pieces(results, 0.3 * np.array([0.0, 0.02, 0.005, 0.01, 0.015]))[0])


def test_peaks_close_to_a_limit_are_searched_more_closely_than_others():
    assert open_pieces_of_a_peak(0.96) == 4
    assert open_pieces_of_a_peak(0.94) == 0


@pytest.mark.parametrize(("inside", "count"), [("SETTLED", 1), ("NOT_SETTLED", 0)])
def test_the_end_of_a_fall_is_searched_unless_no_pose_settles_there(inside, count):
    results = results_with([-0.9, -0.75, -0.75, -0.75, -0.75])
    results["friction_utilisation"] = results["torque_saturation"] = 0.0
    results["wheel_speed"], results["status"][2:] = 0.3, PoseStatus[inside]
    xs = 0.02 * np.array([0.0, 1.0, 0.25, 0.5, 0.75])
    assert len(sorted_pieces(results, xs)[0]) == count


def test_way_time_and_energy_are_summed_over_settled_stretches():
    rng = np.random.default_rng(0)
    results, poses = results_with(np.zeros(50)), rng.normal(size=(50, 3))
    results["q"], results["power"] = rng.normal(size=(50, 6)), rng.uniform(size=50)
    lost = np.zeros(50, bool)
    lost[[7, 8, 30]] = True
    results["status"][lost] = PoseStatus.NOT_SETTLED
    results["q"][lost] = results["power"][lost] = np.nan
    sums = np.empty((3, 50))
    add_up(poses, results, 0.35, (0.0, 0.0, 0.0), sums)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    durations = np.hypot(steps, np.nan_to_num(np.diff(results["q"][:, 0]))) / 0.03
    power = np.nan_to_num(results["power"])
    work = 0.5 * (power[1:] + power[:-1]) * durations
    for found, increments in zip(sums, (steps, durations, work), strict=True):
        expected = np.concatenate([[0.0], np.cumsum(increments)])
        if increments is not steps:
            expected[lost] = np.nan
        np.testing.assert_array_equal(found, expected)
