# SPDX-License-Identifier: Apache-2.0
"""Long turns within a path are judged all along, however few waypoints they have."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.names import TORQUE_POLICIES
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.partwise import PartwiseJudge
from support.rough_grounds import plane

ROVERS = {name: load_rover(name) for name in ("lsr1", "m2020")}
FIXED = replace(ROVERS["lsr1"], steering=None)
LEVEL = plane(0.0, 0.0, half=3.0)
HALF_TURN = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.pi]])
SPACING = 0.02


def dense(path, count=101):
    """Return the turn between the two poses of a path in `count` poses."""
    return path[0] + np.linspace(0.0, 1.0, count)[:, None] * (path[1] - path[0])


def ground_with_a_post(bearing: float, height: float = 0.3) -> Terrain:
    """Return level ground with a post, 0.52 m away from the origin, at a bearing [rad]."""
    axis = np.arange(-2.0, 2.0 + SPACING, SPACING)
    x, y = np.meshgrid(axis, axis)
    away = np.hypot(x - 0.52 * np.cos(bearing), y - 0.52 * np.sin(bearing))
    return Terrain(np.where(away < 0.06, height, 0.0), SPACING, (-2.0, -2.0))


def ask(path, ground, rover=ROVERS["lsr1"], **options):
    return judge_path(rover, ground, path, SweepOptions(**options))


@pytest.mark.parametrize("policy", TORQUE_POLICIES)
def test_a_turn_fails_where_only_its_middle_does(policy):
    ground = ground_with_a_post(np.radians(65.0))
    prediction, verdict = ask(HALF_TURN, ground, policy=policy)
    assert not ask(HALF_TURN[:1], ground, policy=policy)[1].reasons[0]
    assert prediction.settled.all()
    assert verdict.first_failure == 1
    assert not ask(dense(HALF_TURN), ground, policy=policy)[1].traversable


@pytest.mark.parametrize("policy", TORQUE_POLICIES)
def test_a_turn_passes_where_all_of_it_does(policy):
    assert ask(HALF_TURN, LEVEL, policy=policy)[1].traversable


def test_unknown_ground_below_the_middle_of_a_turn_refuses_it():
    ground = ground_with_a_post(np.radians(65.0))
    unknown = replace(ground, elevation=np.where(ground.elevation > 0.0, np.nan, 0.0))
    prediction, verdict = ask(HALF_TURN, unknown)
    assert verdict.code == "unknown_ground" and verdict.first_failure == 1
    assert (prediction.status == PoseStatus.SETTLED).all()


def test_a_path_that_stops_at_its_failure_and_a_long_one_judge_turns_too():
    rover, ground = ROVERS["lsr1"], ground_with_a_post(np.radians(65.0))
    verdict = ask(HALF_TURN, ground)[1]
    stopped = judge_path(rover, ground, HALF_TURN, SweepOptions(), stop_at_failure=True)[1]
    in_parts = PartwiseJudge(rover, ground, HALF_TURN)
    assert len(list(in_parts.parts())) == 1
    assert stopped.reasons == in_parts.verdict().reasons == verdict.reasons


@pytest.mark.parametrize("name", ROVERS)
def test_within_a_long_turn_no_wheel_goes_farther_than_a_quarter_of_its_radius(name):
    rover = ROVERS[name]
    between = ask(HALF_TURN, LEVEL, rover)[0].between
    yaw = np.concatenate([[0.0], np.unwrap(between.poses[:, 2]), [-np.pi]])
    reach = max(np.hypot(x, y) for x, y, _ in rover.suspension.wheels.values())
    assert np.abs(np.diff(yaw)).max() * reach <= 0.25 * rover.wheel.radius * (1.0 + 1e-9)
    assert not between.poses[:, :2].any()


def test_waypoints_that_are_close_and_ways_that_are_open_have_nothing_in_between():
    assert not len(ask(dense(HALF_TURN), LEVEL)[0].between.poses)
    apart = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, np.pi]])  # turns and goes on at once
    assert not len(ask(apart, LEVEL)[0].between.poses)


def test_the_drift_of_fixed_wheels_in_a_turn_is_that_of_dense_waypoints():
    slope = plane(0.15, 0.0, half=3.0)
    coarse = ask(HALF_TURN, slope, FIXED, policy="servo")[0]
    fine = ask(dense(HALF_TURN), slope, FIXED, policy="servo")[0]
    assert coarse.drift[1] == pytest.approx(fine.drift.max(axis=0), rel=0.05)
    assert coarse.drift[1].max() > 0.0
