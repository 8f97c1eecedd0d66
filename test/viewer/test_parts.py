# SPDX-License-Identifier: Apache-2.0
"""Parts behind the page without a server: trajectories, playback, requests, colours, ground."""

import io
import math
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rover_physics.results.uses import find_uses, limits_of
from rover_physics.traversability.judge import judge_path, judge_poses
from rover_planner.planning.search.query import Site
from rover_planner.viewer.state import colours, layers
from rover_planner.viewer.state.background_work import Inbox
from rover_planner.viewer.state.drive import Playback, Trajectory
from rover_planner.viewer.state.path_limits import find_path_limits
from support.grounds import gap, make_terrain, waves
from support.paths import arc_of
from support.viewer.sessions import LSR1, STRAIGHT

pytest.importorskip("trimesh", reason="no trimesh: pip install '.[view]'")

import trimesh

from rover_planner.viewer.scene import ground_mesh

# Trajectories.


def trajectory_on(height, poses) -> Trajectory:
    judged = judge_path(LSR1, make_terrain(height), poses)
    return Trajectory(LSR1, find_path_limits(LSR1, *judged).rows)


def test_states_are_those_of_the_prediction_and_between_poses_their_mean():
    prediction, _ = judge_path(LSR1, make_terrain(waves), STRAIGHT)
    trajectory, row = trajectory_on(waves, STRAIGHT), 37
    state = trajectory.state_at(float(prediction.time[row]))
    np.testing.assert_allclose(state.wheel_loads, prediction.wheel_loads[row], rtol=1e-9)
    np.testing.assert_allclose(state.position, prediction.position[row], rtol=1e-9)
    ends = [float(time) for time in trajectory.times[10:12]]
    x, *x_ends = (trajectory.state_at(time).position[0] for time in (np.mean(ends), *ends))
    assert x == pytest.approx(np.mean(x_ends), abs=1e-9)
    level = trajectory_on(lambda x, y: 0.0 * x, STRAIGHT)
    end = level.state_at(level.times[-1])
    np.testing.assert_allclose(end.spin, 2.0 / LSR1.wheel.radius, rtol=1e-6)


# Playback.


TIMES = np.linspace(0.0, 10.0, 11)


def drive(times=TIMES) -> SimpleNamespace:
    """Return a drive with poses at the first waypoints, as it is played."""
    return SimpleNamespace(times=times, places=TIMES[: len(times)])


def test_playing_stops_at_the_end_and_starts_again_from_the_beginning():
    playback = Playback(drive(), speed=2.0)
    playback.toggle()
    playback.advance(1.0)
    assert (playback.time, playback.is_playing, playback.moved) == (2.0, True, True)
    playback.advance(10.0)
    assert (playback.time, playback.is_playing) == (10.0, False)
    playback.moved = False
    playback.advance(1.0)
    assert not playback.moved
    playback.toggle()
    assert playback.time == 0.0


def test_a_drive_that_ends_early_does_not_forget_where_the_rover_was():
    playback = Playback(drive(), place=8.0)
    playback.drive = drive(TIMES[:4])
    assert playback.time == playback.duration == 3.0
    playback.drive = drive(2.0 * TIMES)
    assert playback.time == 16.0
    playback.drive = drive(TIMES[:4])
    playback.seek(2.0)
    playback.drive = drive()
    assert playback.time == 2.0


def test_steps_go_from_waypoint_to_waypoint():
    playback, seen = Playback(drive(TIMES[:4]), place=1.4), []
    for by in (1, 1, 1, -1, -1, -1, -1):
        playback.step(by)
        seen.append(playback.time)
    assert seen == [2.0, 3.0, 3.0, 2.0, 1.0, 0.0, 0.0]


def test_a_later_value_of_a_name_replaces_the_earlier_one():
    inbox = Inbox({"slider": "first"})
    for value in ("second", "third"):
        inbox.put("step")
        inbox.put(value, "slider")
    assert inbox.wait() and list(inbox.take().values()) == ["step", "step", "third"]
    assert not inbox.wait(0.0) and inbox.take() == {}


def test_colours_go_with_the_value_from_blue_to_vermillion_or_get_lighter_and_are_grey_for_nan():
    used = [colours.colour_use(use) for use in (0.0, 1.0, 7.0, math.nan)]
    assert used == [colours.PASSABLE, colours.REFUSED, colours.REFUSED, colours.UNKNOWN]
    found = colours.map_colours(np.array([0.0, 0.5, 1.0, np.nan]), 0.0, 1.0).astype(int)
    light = found[:3] @ np.array([0.299, 0.587, 0.114])
    assert light[0] < light[1] < light[2] and tuple(found[3]) == colours.UNKNOWN


# The ground.


def test_a_ray_meets_the_ground_where_it_is_aimed_and_nothing_in_the_sky_or_where_none_is_known():
    ground, holed, meet = make_terrain(waves), make_terrain(gap), ground_mesh.intersect_ground
    target = np.array([1.0, 0.5, float(ground.elevation_at(1.0, 0.5))])
    origin = np.array([-3.0, -3.0, 4.0])
    place = meet(ground, origin, target - origin)
    np.testing.assert_allclose(place, target[:2], atol=ground.resolution)
    assert meet(holed, np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.5])) is None
    assert meet(holed, np.array([0.75, 0.0, 2.0]), np.array([0.0, 0.0, -1.0])) is None


def test_the_friction_of_a_map_is_a_layer_where_it_is_known_and_else_none():
    plain = make_terrain(waves)
    friction = np.full(plain.elevation.shape, np.nan)
    friction[:, : friction.shape[1] // 2] = 0.2
    learned = replace(plain, friction=friction)
    assert layers.FRICTION in layers.list_layers(learned)
    assert layers.FRICTION not in layers.list_layers(plain)
    ground = layers.thin(learned)
    found = layers.colour_ground(layers.FRICTION, ground)
    picture = ground_mesh.draw_picture(ground, found).astype(float)
    known, unknown = picture[:, 10], picture[:, -10]
    assert (known[:, 0] < known[:, 2]).all()  # blue
    assert np.ptp(unknown, axis=1).max() == 0.0  # grey


def test_the_ground_has_a_layer_for_the_use_of_each_limit_of_a_pose_and_one_for_all():
    assert {"use of all limits", "use of tilt", "use of friction"} <= set(layers.PREDICTED)
    assert "use of drop" not in layers.PREDICTED  # it is of a path
    ground = make_terrain(lambda x, y: gap(x, y) + 0.3 * x)
    at = np.array([-1.0, 0.75]), np.array([0.0])
    tilt, every = (
        layers.predict_use(Site(LSR1, ground), layers.Colouring(layer), at)[0]
        for layer in ("use of tilt", "use of all limits")
    )
    pose = [[-1.0, 0.0, 0.0]]
    uses = find_uses(limits_of(LSR1, "equal"), judge_poses(LSR1, ground, pose)[0].results)
    row = [limit.code for limit in uses.limits.rows].index("tilt")
    assert tilt[0] == pytest.approx(uses.use[0, row], rel=1e-6) and tilt[0] > 0.5
    assert every[0] == pytest.approx(np.nanmax(uses.use), rel=1e-6)
    assert np.isnan([tilt[1], every[1]]).all()  # unknown ground
    steep = make_terrain(lambda x, y: x)
    grid, how = layers.thin(steep), layers.Colouring("use of tilt")
    found = layers.colour_limit(Site(LSR1, steep), how, grid)
    picture = ground_mesh.draw_picture(grid, found)
    assert np.median(picture[..., 0]) > np.median(picture[..., 2])  # beyond it is vermillion
    assert found.legend["keys"][0] == ("hatched", "beyond the limit")


def test_the_known_ground_is_a_file_that_needs_no_light_and_leaves_no_garbage(monkeypatch):
    terrain, pictures = layers.thin(make_terrain(gap)), []
    ground, origin = layers.colour_ground(layers.SLOPE, terrain), np.array([0.5, -0.25, 0.0])
    drawn = ground_mesh.draw_picture(terrain, ground)
    monkeypatch.setattr(ground_mesh, "draw_picture", lambda *_: pictures.pop())
    pictures.append(drawn.copy())
    held = weakref.ref(pictures[0])
    file = ground_mesh.write_ground(terrain, ground, origin)
    assert held() is None and b"KHR_materials_unlit" in file
    (read,) = trimesh.load(io.BytesIO(file), file_type="glb").geometry.values()
    np.testing.assert_allclose(read.vertices[0] + origin, [*terrain.origin, gap(*terrain.origin)])
    x = read.triangles_center[:, 0] + origin[0]
    assert x.min() < 0.55 and not ((x > 0.55) & (x < 0.95)).any() and x.max() > 0.95
    np.testing.assert_array_equal(np.asarray(read.visual.material.baseColorTexture), drawn)


def test_the_axles_are_those_of_the_model_on_rough_ground():
    trajectory = trajectory_on(waves, arc_of(1.0, np.linspace(0.0, 1.0, 41)))
    state = trajectory.state_at(0.5 * trajectory.times[-1])
    outwards = state.wheel_centres - state.contact_points
    away = np.abs((outwards * state.axles).sum(axis=1))
    assert (away <= 0.5 * LSR1.wheel.width + 1e-6).all()
    radial = np.sqrt((outwards**2).sum(axis=1) - away**2)
    assert radial == pytest.approx(np.full(6, LSR1.wheel.radius), abs=2e-3)
