"""What the page is made of, without a browser: journeys, colours, boards and plots."""

import dataclasses
import math

import numpy as np
import pytest

from rover_physics.names import WHEELS
from rover_physics.traversability.judge_path import judge_path
from rover_planner.viewer.panel.board import describe_verdict, draw_board
from rover_planner.viewer.panel.charts import CHARTS, with_cursor
from rover_planner.viewer.panel.history import History
from rover_planner.viewer.scene.colours import PASSABLE, REFUSED, UNKNOWN, of_use, ramp
from rover_planner.viewer.state.journey import Journey
from rover_planner.viewer.state.layers import LAYERS
from rover_planner.viewer.state.playback import FAST, Playback
from rover_planner.viewer.state.visitor_requests import VisitorRequests
from support.grounds import gap, make_terrain, wall_at, waves
from support.viewer_sessions import LSR1, session_on, straight

pytest.importorskip("trimesh", reason="no trimesh: pip install '.[view]'")

from rover_planner.viewer.scene.ground_mesh import draw_ground, hit_ground
from rover_planner.viewer.scene.overlays import MAX_GHOSTS, choose_ghosts

# Journeys.


def journey_on(height, poses=None) -> Journey:
    terrain = make_terrain(height)
    return Journey(LSR1, *judge_path(LSR1, terrain, straight() if poses is None else poses))


def test_a_frame_at_a_waypoint_is_the_prediction_there():
    journey = journey_on(waves)
    row = 37
    frame = journey.frame(float(journey.times[row]))
    assert frame is not None
    np.testing.assert_allclose(frame.wheel_loads, journey.prediction.wheel_loads[row], rtol=1e-9)
    np.testing.assert_allclose(frame.position, journey.prediction.position[row], rtol=1e-9)


def test_a_frame_half_way_between_waypoints_is_between_them():
    journey = journey_on(waves)
    times = journey.times
    frame = journey.frame(0.5 * float(times[10] + times[11]))
    assert frame is not None
    assert frame.position[0] == pytest.approx(
        journey.prediction.position[10:12, 0].mean(), abs=1e-9
    )


def test_wheels_on_level_ground_turn_by_the_way_over_the_radius():
    journey = journey_on(lambda x, y: 0.0 * x)
    frame = journey.frame(journey.duration)
    assert frame is not None
    np.testing.assert_allclose(frame.spin, 2.0 / LSR1.wheel.radius, rtol=1e-6)


def test_a_journey_ends_where_the_path_is_refused():
    journey = journey_on(wall_at(0.5))
    assert not journey.verdict.traversable
    assert journey.length <= journey.verdict.first_failure + 1
    assert journey.length < len(journey.prediction.poses)


def test_a_journey_that_cannot_begin_has_no_frame():
    journey = journey_on(gap, np.add(straight(), [1.75, 0.0, 0.0]))
    assert journey.length == 0
    assert journey.frame(0.0) is None


# The clock.


def test_fast_forward_and_rewind_are_faster_than_play():
    clock = Playback(duration=1000.0, speed=2.0)
    clock.play()
    clock.advance(1.0)
    assert clock.time == pytest.approx(2.0)
    clock.fast_forward()
    clock.advance(1.0)
    assert clock.time == pytest.approx(2.0 + 2.0 * FAST)
    clock.rewind()
    clock.advance(1.0)
    assert clock.time == pytest.approx(2.0)


def test_playing_stops_at_the_end_and_starts_again_from_the_beginning():
    clock = Playback(duration=3.0, speed=2.0)
    clock.play()
    clock.advance(10.0)
    assert (clock.time, clock.rate) == (3.0, 0.0)
    clock.play()
    assert clock.time == 0.0


def test_another_journey_goes_on_at_the_same_share_of_the_way():
    clock = Playback(duration=10.0, time=5.0)
    clock.restart(20.0)
    assert clock.time == pytest.approx(10.0)


def test_steps_go_from_waypoint_to_waypoint():
    playback, times = Playback(duration=3.0, time=1.4), np.array([0.0, 1.0, 2.0, 3.0])
    seen = []
    for by in (1, 1, 1, -1, -1, -1, -1):
        playback.step(times, by)
        seen.append(playback.time)
    assert seen == [2.0, 3.0, 3.0, 2.0, 1.0, 0.0, 0.0]


# VisitorRequests.


def test_a_later_wish_of_a_kind_replaces_the_earlier_one():
    wishes, done = VisitorRequests(), []
    for number in range(5):
        wishes.ask(lambda number=number: done.append(number), "slider")
    wishes.ask(lambda: done.append("step"))
    wishes.ask(lambda: done.append("step"))
    for act in wishes.take():
        act()
    assert done == [4, "step", "step"]
    assert wishes.take() == []


# Colours.


def test_the_colour_of_a_wheel_goes_from_blue_to_vermillion_and_is_grey_where_not_known():
    assert of_use(0.0) == PASSABLE
    assert of_use(1.0) == of_use(7.0) == REFUSED
    assert of_use(math.nan) == UNKNOWN


def test_the_ramp_gets_lighter_with_the_value_and_is_grey_where_unknown():
    colours = ramp(np.array([0.0, 0.5, 1.0, np.nan]), 0.0, 1.0).astype(int)
    weights = np.array([0.299, 0.587, 0.114])
    light = colours[:3] @ weights
    assert light[0] < light[1] < light[2]
    assert tuple(colours[3]) == UNKNOWN


# The ground.


def test_a_click_meets_the_ground_where_the_ray_does():
    terrain = make_terrain(waves)
    target = np.array([1.0, 0.5, float(terrain.elevation_at(1.0, 0.5))])
    origin = np.array([-3.0, -3.0, 4.0])
    place = hit_ground(terrain, origin, target - origin)
    assert place is not None
    np.testing.assert_allclose(place, target[:2], atol=terrain.resolution)


def test_a_click_at_the_sky_or_on_unknown_ground_meets_nothing():
    terrain = make_terrain(gap)
    assert hit_ground(terrain, np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.5])) is None
    down = np.array([0.0, 0.0, -1.0])
    assert hit_ground(terrain, np.array([0.75, 0.0, 2.0]), down) is None


@pytest.mark.parametrize("layer", LAYERS)
def test_the_ground_has_a_picture_of_every_layer(layer):
    ground = draw_ground(LSR1, make_terrain(waves, half=2.0), layer, 0.3)
    assert np.isfinite([ground.low, ground.high]).all() and ground.low < ground.high
    picture = np.asarray(ground.mesh.visual.material.baseColorTexture)
    assert picture.reshape(-1, 3).std(axis=0).max() > 1.0


def test_unknown_ground_is_left_out_of_the_mesh():
    whole, holed = (draw_ground(LSR1, make_terrain(ground), "height") for ground in (waves, gap))
    assert len(holed.mesh.faces) < len(whole.mesh.faces)
    centres = holed.mesh.triangles_center
    assert not ((centres[:, 0] > 0.55) & (centres[:, 0] < 0.95)).any()


def test_steep_ground_is_predicted_to_use_more_friction():
    level, steep = (
        draw_ground(LSR1, make_terrain(lambda x, y, k=k: k * x), "slope") for k in (0.0, 0.5)
    )
    assert (level.unit, steep.unit) == ("deg", "deg")
    pictures = [np.asarray(g.mesh.visual.material.baseColorTexture).mean() for g in (level, steep)]
    assert pictures[1] > pictures[0]


# Board and plots.


def test_the_board_shows_all_loads_with_their_unit():
    frame = journey_on(waves).frame(20.0)
    assert frame is not None
    board = draw_board(LSR1, frame, "paused")
    for load in frame.wheel_loads:
        assert f"{load:.1f} N<" in board
    assert all(wheel in board for wheel in WHEELS)
    assert f"{frame.tip_over_ratio:.2f}" in board


def test_the_board_shows_numbers_with_units():
    frame = journey_on(waves).frame(3.0)
    assert frame is not None
    board = draw_board(LSR1, frame, "paused")
    for text in ("3.0 s", " cm", " J", " N<", "cm/s", "stability margin", "paused"):
        assert text in board


def test_what_is_not_known_is_a_question_mark_on_the_board():
    frame = journey_on(waves).frame(20.0)
    assert frame is not None
    unknown = dataclasses.replace(
        frame, wheel_loads=np.full(6, np.nan), slip_ratio=np.full(6, np.nan)
    )
    board = draw_board(LSR1, unknown, "live")
    assert board.count("? N<") == 6
    assert "nan" not in board


def test_a_verdict_escapes_what_it_quotes():
    text = describe_verdict(False, "<b>", "<script>", "")
    assert "<script>" not in text and "&lt;script&gt;" in text


def test_the_cursor_of_a_plot_is_at_the_distance_and_leaves_the_curves_as_they_are():
    x, values = np.linspace(0.0, 4.0, 9), np.column_stack([np.arange(9.0)])
    at, curve, limit, line = with_cursor(x, values, 1.25, 10.0)
    assert np.isfinite([at, curve, limit, line]).all()
    assert at[np.argmax(line)] == 1.25
    assert (np.diff(at) >= 0.0).all()
    np.testing.assert_allclose(curve, 2.0 * at)


def test_the_history_of_a_live_rover_keeps_what_is_known_every_centimetre():
    history = History()
    frame = journey_on(waves).frame(20.0)
    assert frame is not None
    assert history.add(dataclasses.replace(frame, distance=0.5))
    assert not history.add(dataclasses.replace(frame, distance=0.501))
    assert not history.add(
        dataclasses.replace(frame, distance=0.6, wheel_loads=np.full(6, np.nan))
    )
    assert history.add(dataclasses.replace(frame, distance=0.7))
    np.testing.assert_array_equal(history.distance, [0.5, 0.7])
    assert set(history.values) == set(CHARTS)


# Ghosts.


def test_ghosts_stand_at_refused_waypoints_apart_from_each_other():
    session = session_on(wall_at(0.5), goal=(1.5, 0.0, 0.0))
    candidates = session.candidates
    ghosts = choose_ghosts(LSR1, candidates, shown=1)
    assert 0 < len(ghosts) <= MAX_GHOSTS
    assert ghosts[0] == (1, candidates[1].verdict.first_failure)
    places = np.array([candidates[index].poses[row, :2] for index, row in ghosts])
    assert all(candidates[index].verdict.reasons[row] for index, row in ghosts)
    away = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert (away[~np.eye(len(places), dtype=bool)] > 0.8).all()


def test_a_passable_path_has_no_ghosts():
    session = session_on(lambda x, y: 0.0 * x)
    assert choose_ghosts(LSR1, session.candidates, shown=0) == []
