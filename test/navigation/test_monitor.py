# SPDX-License-Identifier: Apache-2.0
"""A monitor finds the rest of the path and reasons to stop; a stop lasts until the next path."""

from dataclasses import replace

import numpy as np
import pytest

from rover_planner.planning.answering.judgement import SuspensionReport
from rover_planner.planning.answering.server_health import ERROR, OK, WARN
from rover_planner.planning.answering.snapshot import Snapshot
from rover_planner.planning.learned_ground import LearnedGround
from rover_planner.planning.marked_places import MARKED_CODE, MarkedPlace, MarkedPlaces
from rover_planner.planning.navigation.monitor import (
    ARRIVED,
    IDLE,
    STOPPED,
    WATCHING,
    PathMonitor,
    Sight,
    describe_watch,
)
from rover_planner.planning.navigation.watched_path import USUAL_RADIUS, WatchedPath
from support.grounds import make_terrain, wall_at, waves, with_std
from support.services import make_service

STRAIGHT = np.column_stack([np.linspace(-2.0, 2.0, 201), np.zeros(201), np.zeros(201)])


@pytest.fixture(scope="module")
def service():
    return make_service(make_terrain(waves))


def sight(service, pose, time=0.0, ground=waves):
    service.take_terrain(make_terrain(ground))
    pose = None if pose is None else np.array(pose)
    return Sight(service.snapshot(), pose, time)


@pytest.fixture
def monitor(service):
    """Return a monitor that watches a path."""
    monitor = PathMonitor()
    assert monitor.take_path(WatchedPath(STRAIGHT, "abc"), sight(service, STRAIGHT[0]))
    assert monitor.look(sight(service, STRAIGHT[0])).state == WATCHING
    return monitor


def test_the_place_follows_a_path_that_crosses_itself():
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    loop = np.column_stack([np.sin(2 * turn), np.sin(turn), turn])
    path = WatchedPath(loop)
    crossing = path.find_place(loop[100], last=95)
    assert crossing.index == 100
    assert path.find_place(np.array([0.0, 0.0, 0.0]), last=0).index < 10
    assert path.find_place(loop[-1], last=190).remaining == pytest.approx(0.0, abs=0.1)
    on_the_spot = np.column_stack([np.zeros(50), np.zeros(50), np.linspace(0.0, 3.0, 50)])
    assert WatchedPath(on_the_spot).find_place(np.array([0.0, 0.0, 1.5])).index in (24, 25)


def test_a_path_that_comes_back_to_its_start_is_watched_from_the_start(service):
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    loop = np.column_stack([np.sin(turn), 1.0 - np.cos(turn), turn])
    for error in ((0.0, 0.0, -0.02), (-0.01, 0.0, 0.0), (-0.02, 0.01, -0.01)):
        monitor = PathMonitor()
        assert monitor.take_path(WatchedPath(loop), sight(service, error))
        found = monitor.look(sight(service, error))
        assert found.state == WATCHING and found.place.remaining > 6.0


@pytest.mark.parametrize("size", [1.0 / 16.0, 1.0, 16.0])
def test_the_place_goes_on_where_a_path_backs_up_whatever_the_size_of_the_rover(size):
    there = np.linspace(0.0, 0.6, 31)
    x, radius = np.concatenate([there, there[-2::-1]]), size * USUAL_RADIUS
    path = WatchedPath(size * np.column_stack([x, np.zeros((len(x), 2))]))
    random, last, found = np.random.default_rng(3), 0, []
    for place in np.interp(np.arange(0.0, 60.0, 0.25), np.arange(len(x)), x):
        noise = random.normal(0.0, 0.003, 3)
        pose = (np.array([place, 0.05, 0.0]) + noise) * [size, size, 1.0]
        last = path.find_place(pose, last, radius).index
        found.append(last)
    assert np.abs(np.array(found) - np.arange(0.0, 60.0, 0.25)).max() <= 2.0
    assert path.is_end(path.find_place(np.array([0.0, 0.3 * size, 0.0]), last, radius).index)


def test_a_wall_ahead_stops_and_one_behind_does_not(service, monitor):
    assert monitor.look(sight(service, STRAIGHT[50], 1.0)).place.index == 50
    found = monitor.look(sight(service, STRAIGHT[50], 2.0, wall_at(0.5)))
    assert found.state == STOPPED and found.judgement.reason[0].isdigit()
    assert not found.judgement.candidate.is_complete  # it does not wait for what lies beyond
    assert monitor.look(sight(service, STRAIGHT[50], 3.0)).state == STOPPED  # the wall is gone
    assert monitor.take_path(WatchedPath(STRAIGHT), sight(service, STRAIGHT[120], 4.0))
    behind = sight(service, STRAIGHT[120], 5.0, lambda x, y: waves(x, y) + (x < -1.5))
    assert monitor.look(behind).state == WATCHING


def test_what_is_near_is_judged_on_the_map_around_it_so_that_a_large_one_delays_no_stop(
    service, monitor
):
    large = make_terrain(wall_at(0.5), half=12.0)
    service.take_terrain(large)
    found = monitor.look(Sight(service.snapshot(), STRAIGHT[0], 1.0))
    assert found.state == STOPPED
    assert found.judgement.site.terrain.elevation.size < 0.2 * large.elevation.size


@pytest.mark.parametrize(
    ("ground", "std", "is_exact"), [(wall_at(0.5), 0.001, True), (waves, 0.2, False)]
)
def test_a_wall_that_is_certain_stops_before_the_errors_of_the_map_are_allowed_for(
    service, monitor, ground, std, is_exact
):
    service.take_terrain(with_std(make_terrain(ground, half=3.0), std))
    found = monitor.look(Sight(service.snapshot(), STRAIGHT[0], 1.0))
    assert found.state == STOPPED
    assert (found.judgement.candidate.prediction.bounds is None) == is_exact


def test_on_learned_ground_the_rest_is_judged_once_too():
    learned = make_service(make_terrain(waves), learn="use")
    learned.take_ground(LearnedGround(0.7, 0.05, 0.6, True))
    monitor = PathMonitor()
    monitor.take_path(WatchedPath(STRAIGHT), Sight(learned.snapshot(), STRAIGHT[0], 0.0))
    looks = [Sight(learned.snapshot(), STRAIGHT[0], 10.0 * k) for k in range(3)]
    assert [monitor.look(one).judged for one in looks] == [1] * 3
    learned.take_ground(LearnedGround(0.05, 0.01, 0.03, True))
    found = monitor.look(Sight(learned.snapshot(), STRAIGHT[0], 30.0))
    assert found.state == STOPPED


def test_a_place_that_is_marked_ahead_stops(service, monitor):
    marked = MarkedPlaces((MarkedPlace(-1.5, 0.0, 0.3, "stuck there", "today"),))
    here = sight(service, STRAIGHT[0], 10.0)
    assert monitor.look(here).state == WATCHING
    there = replace(here, time=20.0, snapshot=replace(here.snapshot, marked=marked))
    found = monitor.look(there)
    assert (found.state, found.judgement.code) == (STOPPED, MARKED_CODE)


def test_a_map_that_changes_all_the_time_leaves_time_for_others(service, monitor):
    for k in range(20):
        monitor.look(sight(service, STRAIGHT[10], 10.0 + 1e-3 * k))
    assert monitor.finding.judged < 10


def test_the_end_of_the_path_ends_the_watch(service, monitor):
    for row in (60, 120, 200):
        found = monitor.look(sight(service, STRAIGHT[row], float(row)))
    assert found.state == ARRIVED
    assert monitor.look(sight(service, STRAIGHT[200], 300.0, wall_at(0.5))).state == ARRIVED
    monitor.forget()
    assert monitor.look(sight(service, STRAIGHT[0], 301.0)).state == IDLE


def test_a_rover_off_its_path_is_to_stop(service, monitor):
    assert monitor.look(sight(service, (-2.0, 0.4, 0.0), 0.9)).state == WATCHING
    found = monitor.look(sight(service, (-2.0, 0.6, 0.0), 1.0))
    assert (found.state, found.judgement.code) == (STOPPED, "off_path")


def test_a_rover_that_is_lost_is_to_stop(service, monitor):
    assert monitor.look(sight(service, None, 0.9)).state == WATCHING
    found = monitor.look(sight(service, None, 1.1))
    assert found.judgement.code == "no_pose" and "1.1 s" in found.judgement.reason
    assert not monitor.take_path(WatchedPath(STRAIGHT), sight(service, (0.0, 3.0, 0.0), 2.0))
    assert monitor.finding.state == STOPPED


def test_joint_states_that_cease_stop_a_rover_that_had_them(service, monitor):
    here = sight(service, STRAIGHT[0])
    assert monitor.look(replace(here, time=9.0)).state == WATCHING  # it never had any
    measured = replace(here, snapshot=replace(here.snapshot, measured_pose=STRAIGHT[0]))
    assert monitor.look(replace(measured, time=10.0)).state == WATCHING
    assert monitor.look(replace(here, time=10.9)).state == WATCHING
    found = monitor.look(replace(here, time=11.1))
    assert (found.state, found.judgement.code) == (STOPPED, "no_joints")


def test_a_difference_counts_once_it_has_lasted(service, monitor, monkeypatch):
    def look(time, size=None):
        report = size and SuspensionReport({"bogie_left": -size, "bogie_right": 0.0}, False)
        monkeypatch.setattr(Snapshot, "compare_standing", lambda _: report)
        return monitor.look(sight(service, STRAIGHT[0], time))

    for k in range(16):
        assert look(0.1 * k, 0.1 if k == 5 else 0.4).state == WATCHING
    assert look(1.7).state == WATCHING  # nothing was compared
    assert look(4.0, 0.4).state == WATCHING  # nor for long before
    assert look(4.9, 0.4).state == WATCHING
    found = look(5.1, 0.4)
    assert (found.state, found.judgement.code) == (STOPPED, "suspension")
    assert "-0.400 rad at bogie_left" in found.judgement.reason
    assert look(5.4).mismatch["bogie_left"] == -0.4
    assert look(9.0).mismatch == {}


def test_health_tells_a_stop_then_drift_with_its_size(service, monitor):
    found = replace(monitor.finding, mismatch={"bogie_left": -0.25})
    assert describe_watch(monitor.finding, True, 0.1).level == OK
    health = describe_watch(found, True, 0.1)
    assert health.level == WARN and "0.250 rad" in health.message
    assert health.values["mismatch bogie_left"] == "-0.2500 rad"
    assert describe_watch(found, False, 0.3).level == OK
    stopped = monitor.look(sight(service, None, 9.0))
    assert describe_watch(stopped, True, 0.1).level == ERROR
