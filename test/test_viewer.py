"""What the page is made of, without a browser: journeys, colours, boards, plots and values."""

import dataclasses
import math

import numpy as np
import pytest
from grounds import gap, make_terrain, wall_at, waves

from rover_physics.errors import RoverFileError
from rover_physics.names import WHEELS
from rover_physics.rover import load_rover, preset_names
from rover_physics.terrain import Terrain
from rover_physics.trap import judge_path
from rover_planner.errors import PlanningError
from rover_planner.prediction_files import read_prediction, write_prediction
from rover_planner.viewer.board import describe_verdict, draw_board
from rover_planner.viewer.charts import CHARTS, with_cursor
from rover_planner.viewer.colours import PASSABLE, REFUSED, UNKNOWN, of_use, ramp
from rover_planner.viewer.history import History
from rover_planner.viewer.journey import Journey
from rover_planner.viewer.layers import LAYERS
from rover_planner.viewer.playback import FAST, Playback
from rover_planner.viewer.rover_values import (
    get_value,
    list_values,
    read_rover,
    rover_to_dict,
    with_value,
    write_rover,
)
from rover_planner.viewer.session import ViewSession
from rover_planner.viewer.wishes import Wishes

pytest.importorskip("trimesh", reason="no trimesh: pip install '.[view]'")

from rover_planner.viewer.ground_mesh import draw_ground, hit_ground
from rover_planner.viewer.overlays import MOST_GHOSTS, choose_ghosts

LSR1 = load_rover("lsr1")


def straight(length: float = 2.0, spacing: float = 0.02) -> np.ndarray:
    x = np.arange(-1.0, length - 1.0 + 1e-9, spacing)
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def session_on(height, start=(-2.0, 0.0, 0.0), goal=(1.0, 0.0, 0.0)) -> ViewSession:
    return ViewSession(LSR1, make_terrain(height), start, goal)


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


# Wishes.


def test_a_later_wish_of_a_kind_replaces_the_earlier_one():
    wishes, done = Wishes(), []
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
    ghosts = choose_ghosts(LSR1, list(session.answer.candidates))
    assert 0 < len(ghosts) <= MOST_GHOSTS
    places = np.array([candidate.poses[row, :2] for candidate, row in ghosts])
    assert all(candidate.verdict.reasons[row] for candidate, row in ghosts)
    away = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert (away[~np.eye(len(places), dtype=bool)] > 0.8).all()


def test_a_passable_path_has_no_ghosts():
    session = session_on(lambda x, y: 0.0 * x)
    assert choose_ghosts(LSR1, list(session.answer.candidates)) == []


# The values of a rover.


@pytest.mark.parametrize("name", preset_names())
def test_a_rover_that_is_written_and_read_is_the_same(name):
    rover = load_rover(name)
    assert read_rover(write_rover(rover), "here") == rover


@pytest.mark.parametrize("name", preset_names())
def test_every_value_on_offer_is_within_its_range_and_can_be_set(name):
    rover = load_rover(name)
    data = rover_to_dict(rover)
    for values in list_values(rover).values():
        for value in values:
            now = get_value(data, value.keys[0])
            assert value.low <= now <= value.high and value.low < value.high, value.label
            assert value.label.endswith("]"), value.label
            assert with_value(rover, value.keys, now) == rover


def test_a_value_changes_what_it_names_and_nothing_else():
    changed = with_value(LSR1, [("wheel", "radius")], 0.12)
    assert changed.wheel.radius == 0.12
    assert with_value(changed, [("wheel", "radius")], 0.10) == LSR1


def test_the_height_of_the_wheels_moves_all_six():
    (height,) = (v for v in list_values(LSR1)["Links"] if v.label == "wheels z [m]")
    rover = with_value(LSR1, height.keys, -0.25)
    assert {wheel[2] for wheel in rover.suspension.wheels.values()} == {-0.25}


def test_text_that_is_no_rover_file_is_refused_with_its_name():
    with pytest.raises(PlanningError, match="mine.yaml"):
        read_rover("{", "mine.yaml")
    with pytest.raises(RoverFileError, match="mine.yaml"):
        read_rover("name: x", "mine.yaml")


# The session.


def test_a_refused_value_says_why_and_the_last_good_rover_stays():
    session = session_on(waves)
    shown = session.shown
    assert not session.change_rover([("suspension", "wheels", "middle", 0)], 0.4)
    assert "suspension.wheels.front" in session.refusal
    assert session.rover == LSR1 and session.shown is shown
    assert session.change_rover([("friction",)], 0.5)
    assert session.refusal == "" and session.rover.friction == 0.5


def test_what_is_refused_changes_nothing_and_says_why():
    session = session_on(waves)
    shown, answer = session.shown, session.answer
    assert not session.change_rover([("wheel", "radius")], -1.0)
    assert "wheel.radius" in session.refusal
    assert not session.plan_to(np.array([np.nan, 0.0]))
    assert not session.change_arm("arm_yaw", float("nan"))
    assert not session.take_options(policy="best")
    assert session.shown is shown and session.answer is answer
    assert session.rover == LSR1 and session.goal == (1.0, 0.0, 0.0)
    assert session.plan_to(np.array([0.5, 0.5])) and not session.refusal


def test_less_friction_uses_up_more_of_it_on_the_path_that_is_shown():
    session = session_on(waves)
    before = session.shown.verdict.max_friction_utilisation
    session.change_rover([("friction",)], 0.4)
    after = session.shown.verdict.max_friction_utilisation
    assert after == pytest.approx(2.0 * before, rel=1e-6)


def test_an_arm_held_out_moves_load_to_its_side():
    session = session_on(lambda x, y: 0.0 * x)
    session.change_rover([("manipulator", "payload")], 2.0)
    session.change_arm("arm_yaw", 0.0)
    ahead = session.shown.candidate.prediction.wheel_loads[0]
    session.change_arm("arm_yaw", 3.14159)
    behind = session.shown.candidate.prediction.wheel_loads[0]
    front, rear = [WHEELS.index(f"{end}_left") for end in ("front", "rear")]
    assert ahead[front] > behind[front] and ahead[rear] < behind[rear]


def test_a_goal_off_the_map_is_refused_with_a_reason_by_the_verdict():
    session = session_on(waves)
    session.plan_to(np.array([9.0, 0.0]))
    assert not session.answer.traversable
    assert "off the map" in session.shown.verdict.reason


def recorded(folder, poses):
    terrain = make_terrain(wall_at(0.5))
    prediction, verdict = judge_path(LSR1, terrain, poses)
    write_prediction(folder / "out.npz", prediction, verdict)
    session = ViewSession(LSR1, terrain, (-2.0, 0.0, 0.0), (-1.5, 0.0, 0.0))
    session.replay(*read_prediction(folder / "out.npz"))
    return session, prediction, verdict


def test_a_recorded_prediction_is_shown_as_it_was_written(tmp_path):
    session, prediction, verdict = recorded(tmp_path, straight())
    shown = session.shown
    assert shown.verdict.reason == verdict.reason != ""
    assert shown.verdict.first_failure == verdict.first_failure
    frame = shown.journey.frame(10.0)
    expected = Journey(LSR1, prediction, verdict).frame(10.0)
    assert frame is not None and expected is not None
    np.testing.assert_allclose(frame.wheel_loads, expected.wheel_loads)
    np.testing.assert_allclose(frame.contact_points, expected.contact_points)


def test_a_recorded_reason_counts_whatever_the_model_says_now(tmp_path):
    prediction, verdict = judge_path(LSR1, make_terrain(waves), straight())
    write_prediction(tmp_path / "out.npz", prediction, verdict)
    again, reasons = read_prediction(tmp_path / "out.npz")
    session = session_on(waves)
    session.replay(again, (*reasons[:-1], "the wheel is stuck"))
    assert not session.shown.verdict.traversable
    assert session.shown.verdict.reason == "the wheel is stuck"


def test_a_file_without_predictions_is_refused_by_name(tmp_path):
    np.savez(tmp_path / "poses.npz", poses=straight())
    with pytest.raises(PlanningError, match=r"no array 'settled'"):
        read_prediction(tmp_path / "poses.npz")


def test_a_recorded_path_stays_the_one_that_is_judged_when_the_rover_changes(tmp_path):
    session, prediction, _ = recorded(tmp_path, straight())
    assert session.change_rover([("friction",)], 0.4)
    assert session.plan_again()
    assert len(session.answer.candidates) == 1
    np.testing.assert_array_equal(session.shown.candidate.poses, prediction.poses)
    session.plan_to(np.array([2.5, 0.5]))
    assert len(session.answer.candidates) > 1 and not session.recorded


def test_a_session_on_a_terrain_with_soil_takes_its_soils():
    flat = make_terrain(lambda x, y: 0.0 * x)
    soil = np.zeros(flat.elevation.shape, np.int32)
    sandy = Terrain(
        flat.elevation, flat.resolution, flat.origin, soil=soil, soil_names=("dry_sand",)
    )
    session = ViewSession(LSR1, sandy, (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert session.shown.verdict.max_sinkage > 0.0
