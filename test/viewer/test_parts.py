# SPDX-License-Identifier: Apache-2.0
"""Parts behind the page without a server: trajectories, playback, requests, colours, ground."""

import gc
import io
import math
import weakref
from dataclasses import replace

import numpy as np
import pytest

from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.traversability.judge import judge_path, judge_poses
from rover_planner.planning.path_query import check_path
from rover_planner.viewer.state.colours import (
    PASSABLE,
    REFUSED,
    UNKNOWN,
    colour_use,
    map_colours,
)
from rover_planner.viewer.state.inbox import Inbox
from rover_planner.viewer.state.layers import FRICTION, PREDICTED, list_layers, predict_use
from rover_planner.viewer.state.playback import FAST, Playback
from rover_planner.viewer.state.trajectory import Trajectory
from support.grounds import gap, make_terrain, wall_at, waves
from support.viewer.sessions import LSR1, straight

pytest.importorskip("trimesh", reason="no trimesh: pip install '.[view]'")

import trimesh

from rover_planner.viewer.scene.glb import write_glb
from rover_planner.viewer.scene.ground_mesh import build_ground_mesh, intersect_ground

# Trajectories.


def trajectory_on(height, poses=None) -> Trajectory:
    terrain = make_terrain(height)
    return Trajectory(LSR1, *judge_path(LSR1, terrain, straight() if poses is None else poses))


def test_states_are_those_of_the_prediction_and_between_waypoints_their_mean():
    trajectory = trajectory_on(waves)
    row = 37
    state = trajectory.state_at(float(trajectory.times[row]))
    assert state is not None
    np.testing.assert_allclose(
        state.wheel_loads, trajectory.prediction.wheel_loads[row], rtol=1e-9
    )
    np.testing.assert_allclose(state.position, trajectory.prediction.position[row], rtol=1e-9)
    times = trajectory.times
    between = trajectory.state_at(0.5 * float(times[10] + times[11]))
    middle = trajectory.prediction.position[10:12, 0].mean()
    assert between is not None and between.position[0] == pytest.approx(middle, abs=1e-9)
    level = trajectory_on(lambda x, y: 0.0 * x)
    end = level.state_at(level.duration)
    assert end is not None
    np.testing.assert_allclose(end.spin, 2.0 / LSR1.wheel.radius, rtol=1e-6)


def test_a_trajectory_ends_where_the_path_is_refused():
    prediction, verdict = judge_path(LSR1, make_terrain(wall_at(0.5)), straight())
    trajectory = Trajectory(LSR1, prediction, verdict)
    assert verdict.first_failure >= 0 and trajectory.length <= verdict.first_failure + 1
    assert trajectory.length < len(trajectory.prediction.poses)


def test_a_trajectory_without_waypoints_has_no_state():
    trajectory = trajectory_on(gap, np.add(straight(), [1.75, 0.0, 0.0]))
    assert trajectory.length == 0
    assert trajectory.state_at(0.0) is None


# Playback.


def test_rewind_is_faster_than_play():
    playback = Playback(duration=1000.0, speed=2.0)
    for _ in range(2):
        playback.play()
        playback.advance(FAST)
    assert playback.time == pytest.approx(4.0 * FAST)
    playback.rewind()
    playback.advance(1.0)
    assert playback.time == pytest.approx(2.0 * FAST)


def test_playing_stops_at_the_end_and_starts_again_from_the_beginning():
    playback = Playback(duration=3.0, speed=2.0)
    playback.play()
    playback.advance(10.0)
    assert (playback.time, playback.rate) == (3.0, 0.0)
    playback.play()
    assert playback.time == 0.0


METRE_PER_SECOND = np.linspace(0.0, 10.0, 11)


def test_a_drive_that_ends_early_does_not_forget_where_the_rover_was():
    playback = Playback()
    playback.set_drive(METRE_PER_SECOND, METRE_PER_SECOND)
    playback.seek(8.0)
    playback.set_drive(METRE_PER_SECOND[:4], METRE_PER_SECOND[:4])
    assert playback.time == playback.duration == pytest.approx(3.0)
    playback.set_drive(METRE_PER_SECOND, METRE_PER_SECOND)
    assert playback.time == pytest.approx(8.0)
    playback.set_drive(METRE_PER_SECOND[:4], METRE_PER_SECOND[:4])
    playback.seek(2.0)
    playback.set_drive(METRE_PER_SECOND, METRE_PER_SECOND)
    assert playback.time == pytest.approx(2.0)


def test_a_rover_that_turns_on_the_spot_goes_on_turning_there_in_another_drive():
    times, distance = np.array([0.0, 1.0, 5.0, 6.0]), np.array([0.0, 1.0, 1.0, 2.0])
    playback = Playback()
    playback.set_drive(times, distance)
    playback.seek(3.0)
    playback.set_drive(2.0 * times, distance)
    assert playback.time == pytest.approx(4.0)


def test_steps_go_from_waypoint_to_waypoint():
    playback, times = Playback(duration=3.0, time=1.4), np.array([0.0, 1.0, 2.0, 3.0])
    seen = []
    for by in (1, 1, 1, -1, -1, -1, -1):
        playback.step(times, by)
        seen.append(playback.time)
    assert seen == [2.0, 3.0, 3.0, 2.0, 1.0, 0.0, 0.0]


def test_a_later_value_of_a_name_replaces_the_earlier_one():
    inbox = Inbox({"slider": "first"})
    for value in ("second", "third"):
        inbox.put("step")
        inbox.put(value, "slider")
    assert inbox.wait() and list(inbox.take().values()) == ["step", "step", "third"]
    assert not inbox.wait(0.0) and inbox.take() == {}


# Colours.


def test_the_colour_of_a_wheel_goes_from_blue_to_vermillion_and_is_grey_for_nan():
    assert colour_use(0.0) == PASSABLE
    assert colour_use(1.0) == colour_use(7.0) == REFUSED
    assert colour_use(math.nan) == UNKNOWN


def test_colours_get_lighter_with_the_value_and_are_grey_for_nan():
    colours = map_colours(np.array([0.0, 0.5, 1.0, np.nan]), 0.0, 1.0).astype(int)
    weights = np.array([0.299, 0.587, 0.114])
    light = colours[:3] @ weights
    assert light[0] < light[1] < light[2]
    assert tuple(colours[3]) == UNKNOWN


# The ground.


def test_a_click_is_where_its_ray_meets_the_ground():
    terrain = make_terrain(waves)
    target = np.array([1.0, 0.5, float(terrain.elevation_at(1.0, 0.5))])
    origin = np.array([-3.0, -3.0, 4.0])
    place = intersect_ground(terrain, origin, target - origin)
    assert place is not None
    np.testing.assert_allclose(place, target[:2], atol=terrain.resolution)


def test_a_ray_into_the_sky_or_onto_unknown_ground_meets_nothing():
    terrain = make_terrain(gap)
    assert intersect_ground(terrain, np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.5])) is None
    down = np.array([0.0, 0.0, -1.0])
    assert intersect_ground(terrain, np.array([0.75, 0.0, 2.0]), down) is None


def test_unknown_ground_is_left_out_of_the_mesh():
    whole, holed = (
        build_ground_mesh(LSR1, make_terrain(ground), "height") for ground in (waves, gap)
    )
    assert len(holed.mesh.faces) < len(whole.mesh.faces)
    centres = holed.mesh.vertices[holed.mesh.faces].mean(axis=1)
    assert not ((centres[:, 0] > 0.55) & (centres[:, 0] < 0.95)).any()


def test_the_friction_of_a_map_is_a_layer_where_it_is_known_and_else_none():
    plain = make_terrain(waves)
    friction = np.full(plain.elevation.shape, np.nan)
    friction[:, : friction.shape[1] // 2] = 0.2
    learned = replace(plain, friction=friction)
    assert FRICTION in list_layers(learned) and FRICTION not in list_layers(plain)
    picture = build_ground_mesh(LSR1, learned, FRICTION).mesh.picture.astype(float)
    known, unknown = picture[:, 10], picture[:, -10]
    assert (known[:, 0] < known[:, 2]).all()  # blue
    assert np.ptp(unknown, axis=1).max() == 0.0  # grey


def test_the_ground_has_a_layer_for_the_use_of_each_limit_of_a_pose_and_one_for_all():
    assert {"use of all limits", "use of tilt", "use of friction"} <= set(PREDICTED)
    assert "use of drop" not in PREDICTED  # it is of a path
    ground = make_terrain(lambda x, y: gap(x, y) + 0.3 * x)
    at = np.array([-1.0, 0.75]), np.array([0.0])
    tilt, every = (
        predict_use(code, LSR1, ground, 0.0, at, DEFAULT_OPTIONS)[0] for code in ("tilt", "")
    )
    pose = [[-1.0, 0.0, 0.0]]
    uses = find_uses(limits_of(LSR1, "equal"), judge_poses(LSR1, ground, pose)[0].results)
    row = [limit.code for limit in uses.limits.rows].index("tilt")
    assert tilt[0] == pytest.approx(uses.use[0, row], rel=1e-6) and tilt[0] > 0.5
    assert every[0] == pytest.approx(np.nanmax(uses.use), rel=1e-6)
    assert np.isnan([tilt[1], every[1]]).all()  # unknown ground
    hatched = build_ground_mesh(LSR1, make_terrain(lambda x, y: x), "use of tilt").mesh.picture
    assert np.median(hatched[..., 0]) > np.median(hatched[..., 2])  # beyond it is vermillion


def test_another_reader_finds_the_same_surface_and_picture_in_the_file_of_a_ground():
    mesh = build_ground_mesh(LSR1, make_terrain(gap), "slope").mesh
    origin = np.array([0.5, -0.25, 0.0])
    (read,) = trimesh.load(io.BytesIO(write_glb(mesh, origin)), file_type="glb").geometry.values()
    np.testing.assert_allclose(read.vertices, mesh.vertices - origin, atol=1e-6)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    np.testing.assert_allclose(1.0 - read.visual.uv[:, 1], mesh.uv[:, 1], atol=1e-6)
    picture = np.asarray(read.visual.material.baseColorTexture)
    np.testing.assert_array_equal(picture, mesh.picture)


def test_grounds_that_are_drawn_one_after_another_leave_no_garbage():
    terrain = make_terrain(waves)
    gc.disable()
    try:
        held = weakref.ref(mesh := build_ground_mesh(LSR1, terrain, "height").mesh)
        write_glb(mesh, np.zeros(3))
        del mesh
        assert held() is None
    finally:
        gc.enable()


def arc(radius, length=1.0, count=41):
    turned = np.linspace(0.0, length / radius, count)
    x, y = radius * np.sin(turned), radius * (1.0 - np.cos(turned))
    return np.column_stack([x, y, turned])


def drive(poses, ground=lambda x, y: 0.0 * x):
    rover = LSR1
    candidate = check_path(rover, make_terrain(ground, half=4.0), poses)
    trajectory = Trajectory(rover, candidate.prediction, candidate.verdict)
    return rover, trajectory.state_at(0.5 * trajectory.duration)


def test_the_axles_are_those_of_the_model_on_rough_ground():
    rover, state = drive(arc(1.0), waves)
    outwards = state.wheel_centres - state.contact_points
    away = np.abs((outwards * state.axles).sum(axis=1))
    assert (away <= 0.5 * rover.wheel.width + 1e-6).all()
    radial = np.sqrt((outwards**2).sum(axis=1) - away**2)
    assert radial == pytest.approx(np.full(6, rover.wheel.radius), abs=2e-3)
