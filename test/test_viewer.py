"""What is behind the page: the clock, the journey, the rover's values, the session, recordings."""

import numpy as np
import pytest
from grounds import make_terrain, waves
from rover_geometry import attitude_of

from rover_physics.limits import judge
from rover_physics.rover import load_rover
from rover_physics.sweep import sweep_path
from rover_planner.errors import PlanningError
from rover_planner.path_query import PathQueryOptions
from rover_planner.prediction_files import read_prediction, write_prediction
from rover_planner.viewer.board import draw_board
from rover_planner.viewer.ground_mesh import hit_ground
from rover_planner.viewer.journey import Journey
from rover_planner.viewer.playback import FAST, Playback
from rover_planner.viewer.rotations import matrix_of
from rover_planner.viewer.rover_values import (
    get_value,
    list_values,
    read_rover,
    rover_to_dict,
    with_value,
    write_rover,
)
from rover_planner.viewer.session import ViewSession

LSR1 = load_rover("lsr1")
X = np.linspace(-1.0, 1.0, 101)
POSES = np.column_stack([X, 0.1 * X, 0.1 * np.ones_like(X)])


def predict(ground=None):
    prediction = sweep_path(LSR1, ground or make_terrain(waves), POSES)
    return prediction, judge(LSR1, prediction)


def test_playing_moves_on_by_the_chosen_speed_and_stops_at_the_end():
    playback = Playback(duration=100.0, speed=10.0)
    assert not playback.advance(1.0)
    playback.play()
    assert playback.advance(1.0) and playback.time == 10.0
    playback.fast_forward()
    playback.advance(1.0)
    assert playback.time == 10.0 + FAST * 10.0
    playback.advance(60.0)
    assert playback.time == 100.0 and playback.rate == 0.0
    playback.rewind()
    playback.advance(1.0)
    assert playback.time == 60.0
    playback.advance(60.0)
    assert playback.time == 0.0 and playback.describe() == "paused"


def test_steps_go_from_waypoint_to_waypoint():
    playback, times = Playback(duration=3.0, time=1.4), np.array([0.0, 1.0, 2.0, 3.0])
    seen = []
    for by in (1, 1, 1, -1, -1, -1, -1):
        playback.step(times, by)
        seen.append(playback.time)
    assert seen == [2.0, 3.0, 3.0, 2.0, 1.0, 0.0, 0.0]


def test_another_journey_starts_at_the_same_share_of_the_way():
    playback = Playback(duration=100.0, time=25.0)
    playback.restart(40.0)
    assert playback.time == 10.0


def test_a_frame_at_a_waypoint_is_the_prediction_there():
    prediction, verdict = predict()
    frame = Journey(LSR1, prediction, verdict).frame(float(prediction.time[30]))
    assert frame.position == pytest.approx(prediction.position[30])
    assert frame.wheel_loads == pytest.approx(prediction.wheel_loads[30])
    assert matrix_of(*frame.attitude) == pytest.approx(attitude_of(prediction, 30))


def test_between_waypoints_a_frame_is_between_theirs():
    prediction, verdict = predict()
    journey = Journey(LSR1, prediction, verdict)
    time = 0.5 * (prediction.time[30] + prediction.time[31])
    frame = journey.frame(float(time))
    middle = 0.5 * (prediction.position[30] + prediction.position[31])
    assert frame.position == pytest.approx(middle)


def test_wheels_turn_by_the_way_they_roll():
    prediction, verdict = predict(make_terrain(lambda x, y: 0.0 * x))
    frame = Journey(LSR1, prediction, verdict).frame(1e9)
    way = np.hypot(2.0, 0.2)
    assert frame.spin == pytest.approx(np.full(6, way / LSR1.wheel.radius), rel=1e-3)


def test_a_journey_ends_where_the_path_is_refused():
    prediction, verdict = predict(
        make_terrain(lambda x, y: waves(x, y) + 0.5 * ((x > 0.9) & (x < 1.2)))
    )
    assert verdict.first_failure > 0
    journey = Journey(LSR1, prediction, verdict)
    assert journey.length <= verdict.first_failure + 1
    assert journey.frame(1e9) is not None


@pytest.mark.parametrize("name", ["lsr1", "m2020"])
def test_a_rover_survives_being_written_and_read(name):
    rover = load_rover(name)
    assert read_rover(write_rover(rover), "file") == rover


def test_every_slider_is_a_number_of_the_rover_within_its_range():
    for rover in (LSR1, load_rover("m2020")):
        data = rover_to_dict(rover)
        for values in list_values(rover).values():
            for value in values:
                now = get_value(data, value.keys[0])
                assert value.low <= now + 1e-9 and now <= value.high + 1e-9, value.label
                assert "[" in value.label and 0.0 < value.step < value.high - value.low


def test_a_value_changes_what_it_names_and_nothing_else():
    changed = with_value(LSR1, [("wheel", "radius")], 0.12)
    assert changed.wheel.radius == 0.12
    assert with_value(changed, [("wheel", "radius")], 0.10) == LSR1


def test_text_that_is_no_rover_is_refused():
    with pytest.raises(PlanningError, match="YAML"):
        read_rover("a: [", "file")


def make_session(**options):
    return ViewSession(
        LSR1, make_terrain(waves), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0),
        PathQueryOptions(count=3, **options),
    )  # fmt: skip


def test_a_changed_rover_is_judged_on_the_same_path():
    session = make_session()
    poses = session.shown.candidate.poses
    before = session.shown.verdict.max_friction_utilisation
    assert session.change_rover([("friction",)], 0.4)
    assert session.shown.candidate.poses is poses or np.array_equal(
        session.shown.candidate.poses, poses
    )
    assert session.shown.verdict.max_friction_utilisation == pytest.approx(2.0 * before, rel=1e-6)
    assert session.plan_again() and session.rover.friction == 0.4


def test_what_is_refused_changes_nothing_and_says_why():
    session = make_session()
    shown, answer = session.shown, session.answer
    assert not session.change_rover([("wheel", "radius")], -1.0)
    assert "wheel.radius" in session.refusal
    assert not session.plan_to(np.array([np.nan, 0.0]))
    assert not session.change_arm("arm_yaw", float("nan"))
    assert not session.take_options(policy="best")
    assert session.shown is shown and session.answer is answer
    assert session.rover == LSR1 and session.goal == (1.0, 0.0, 0.0)
    assert session.plan_to(np.array([0.5, 0.5])) and not session.refusal


def test_the_arm_moves_the_centre_of_mass_and_with_it_the_loads():
    session = make_session()
    before = session.shown.candidate.prediction.wheel_loads[0]
    assert session.change_arm("arm_yaw", 0.0)
    after = session.shown.candidate.prediction.wheel_loads[0]
    assert after[[2, 5]].sum() > before[[2, 5]].sum()


def test_a_recorded_prediction_is_shown_as_it_was(tmp_path):
    prediction, verdict = predict()
    write_prediction(tmp_path / "out.npz", prediction, verdict)
    again, reasons = read_prediction(tmp_path / "out.npz")
    session = make_session()
    session.replay(again, (*reasons[:-1], "the wheel is stuck"))
    assert not session.shown.verdict.traversable
    assert session.shown.verdict.reason == "the wheel is stuck"
    frame = session.shown.journey.frame(float(prediction.time[30]))
    assert frame.contact_points == pytest.approx(prediction.contact_points[30])


def test_a_file_without_predictions_is_refused_by_name(tmp_path):
    np.savez(tmp_path / "poses.npz", poses=POSES)
    with pytest.raises(PlanningError, match=r"no array 'settled'"):
        read_prediction(tmp_path / "poses.npz")


def test_a_click_meets_the_ground_where_the_ray_does():
    ground = make_terrain(waves)
    target = np.array([1.0, -0.5, float(ground.elevation_at(1.0, -0.5))])
    eye = np.array([-2.0, -3.0, 2.0])
    assert hit_ground(ground, eye, target - eye) == pytest.approx(target[:2], abs=0.05)
    assert hit_ground(ground, eye, eye - target) is None


def test_the_board_shows_numbers_with_units_and_marks_what_is_too_much():
    prediction, verdict = predict()
    frame = Journey(LSR1, prediction, verdict).frame(3.0)
    board = draw_board(LSR1, frame, "paused")
    for text in ("3.0 s", " cm", " J", " N<", "cm/s", "stability margin", "paused"):
        assert text in board
