# SPDX-License-Identifier: Apache-2.0
"""The session behind the page, without a browser: rovers, plans, recorded paths, ends."""

from pathlib import Path

import numpy as np
import pytest

from rover_physics.errors import RoverFileError
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.command.prediction_files import read_prediction, write_prediction
from rover_planner.command.view import SEED, choose_ends, name_ground
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import assume
from rover_planner.viewer.documents.paths import describe_changes, describe_paths, describe_verdict
from rover_planner.viewer.state.scenario import CANDIDATES
from support.grounds import make_terrain, wall_at, waves, with_std
from support.rovers import M2020
from support.viewer.sessions import LSR1, STRAIGHT, Judge, blocked_session, ramp, session_on

# What a person looks at, and what it is compared with.

FRICTION = [("friction",)]
Z = [("suspension", "wheels", name, 2) for name in ("rear", "middle", "front")]


def test_a_slider_never_swaps_the_path_that_is_looked_at_and_another_that_passes_is_offered():
    session = blocked_session()
    rows = describe_paths(session.shown)["rows"]
    best = [row["number"] for row in rows if row["word"].endswith("best")]
    assert best == [session.shown.best + 1]
    index = next(k for k, row in enumerate(rows) if not row["passes"])
    session.show_path(index)
    poses = session.shown.path.poses
    for friction in (0.85, 0.3, 0.85):
        session.change_rover(FRICTION, friction)
        assert session.shown.index == index and session.shown.path.poses is poses
        assert session.is_complete and session.shown.scenario.rover.friction == friction
    assert not session.shown.verdict.traversable
    session.take_change(session.wanted.change_options(policy="servo"))
    assert session.shown.path.poses is poses and session.shown.verdict.policy == "servo"
    session.take_change(session.wanted.change_options(policy="equal"))
    [offer] = describe_verdict(session.shown)["offers"]
    assert offer["words"].startswith(f"path {session.shown.offer + 1} passes")
    session.show_path(offer["ask"]["index"])
    assert session.shown.verdict.traversable and session.shown.offer is None


def test_before_and_after_stay_while_something_differs_from_the_loaded_rover():
    session = session_on(ramp)
    loaded = session.shown.path
    for friction, passes in ((0.7, True), (0.3, False), (0.75, True)):
        session.change_rover(FRICTION, friction)
        shown = session.shown
        assert shown.verdict.traversable == passes and shown.reference is loaded
        changes = describe_changes(shown.path, shown.reference, False)
        assert changes["rover"] == [["friction [-]", "0.8", f"{friction:g}"]]
        word = "passes" if passes else "refused"
        assert changes["drive"][0] == ["verdict", "passes", word]
    session.take_change(session.wanted.change_options(joint_angles={"arm_yaw": 0.5}))
    changes = describe_changes(session.shown.path, session.shown.reference, False)
    assert ["arm_yaw [rad]", "3.14159", "0.5"] in changes["rover"]
    session.take_change(session.wanted.as_loaded())
    assert session.shown.reference is None
    # A kept reference takes the place of the loaded rover, also for another policy.
    session.change_rover(FRICTION, 0.7)
    session.keep_reference(session.wanted)
    assert session.shown.reference is None
    session.take_change(session.wanted.change_options(policy="servo"))
    session.show_path(2)
    reference = session.shown.reference
    assert reference.verdict.policy == "equal" and reference.scenario.rover.friction == 0.7
    np.testing.assert_array_equal(reference.poses, session.shown.path.poses)
    session.keep_reference(None)
    assert session.shown.reference.scenario.rover == LSR1


def test_all_paths_are_judged_again_after_a_value_that_is_refused():
    session = session_on(waves)
    with Judge(session) as judge:
        session.change_rover(Z, -0.19)
        with pytest.raises(RoverFileError):
            session.change_rover([("wheel", "radius")], -1.0)
        judge.finish()
        assert session.is_complete and session.wanted.rover.suspension.wheels["rear"][2] == -0.19
        rows = describe_paths(session.shown)["rows"]
        assert not any(row["waits"] for row in rows)
        session.change_rover(FRICTION, 0.7)
        # It is refused when it is judged.
        session.take_change(session.wanted.change_options(soil="best"))
        judge.finish()
        assert "best" in session.refusal
        judge.finish()  # the paths that were left
        assert session.is_complete and "best" in session.refusal


def test_a_refused_change_alters_nothing_and_says_why():
    session = session_on(waves)
    shown = session.shown
    with pytest.raises(RoverFileError):
        session.change_rover([("suspension", "wheels", "middle", 0)], 0.4)
    turned = session.wanted.change_options(joint_angles={"arm_yaw": float("nan")})
    for change in (
        lambda: session.plan_to(np.array([np.nan, 0.0])),
        lambda: session.take_change(turned),
    ):
        change()
        assert session.refusal and session.shown.path is shown.path
        assert session.wanted is shown.scenario
    session.plan_to(np.array([0.5, 0.5]))
    assert not session.refusal


def test_a_new_start_leaves_the_goal_where_it_is_and_both_have_the_yaw_of_the_line_between():
    session = session_on(waves)
    goal, start = session.wanted.goal, (-1.5, -1.0)
    session.plan_to(goal, np.array(start))
    now, yaw = session.shown.scenario, np.arctan2(goal[1] - start[1], goal[0] - start[0])
    assert (now.start[:2], now.goal[:2]) == (start, goal[:2])
    assert now.start[2] == now.goal[2] == yaw


def test_undo_goes_back_change_by_change_and_never_to_another_rover():
    session = session_on(waves)
    for friction in (0.7, 0.6):
        session.change_rover(FRICTION, friction)
    for friction in (0.7, 0.8):
        session.undo()
        assert session.shown.scenario.rover.friction == friction
    with pytest.raises(PlanningError, match="no change"):
        session.undo()
    session.change_rover(FRICTION, 0.6)
    session.take_rover(M2020)
    with pytest.raises(PlanningError, match="no change"):
        session.undo()


def test_candidates_have_the_distances_of_the_rover_that_was_loaded_last():
    session = session_on(waves, options=CANDIDATES)
    own = session.wanted.candidates
    assert (own.spacing, own.waypoint_spacing) == (0.5, 0.02)
    session.change_rover([("wheel", "radius")], 0.11)
    assert session.wanted.candidates == own
    session.take_rover(M2020)
    large, radius = session.wanted.candidates, M2020.wheel.radius
    assert (large.spacing, large.waypoint_spacing) == (5.0 * radius, 0.2 * radius)


def test_a_path_is_judged_under_all_policies_and_one_that_cannot_judge_says_so():
    session = session_on(ramp)
    session.change_rover(FRICTION, 0.1)
    judged = describe_verdict(session.shown)["policies"]
    assert [one["word"] for one in judged] == ["refused"] * 3
    assert not any(one["old"] for one in judged)
    session = session_on(with_std(make_terrain(ramp), 1e-3))
    session.ask()
    _, servo, _ = describe_verdict(session.shown)["policies"]
    assert servo["word"] == "not judged" and "no bounds" in servo["reason"] and not servo["old"]


def test_a_recorded_prediction_is_shown_as_it_was_recorded_until_the_rover_is_changed(tmp_path):
    terrain, file = make_terrain(wall_at(0.5)), tmp_path / "out.npz"
    prediction, verdict = judge_path(LSR1, terrain, STRAIGHT)
    write_prediction(file, prediction, verdict)
    again, reasons, assumptions = read_prediction(file)
    assert assumptions is None
    session = session_on(terrain, goal=(-1.5, 0.0, 0.0))
    session.replay(again, reasons)
    shown = session.shown
    assert shown.verdict.reason == verdict.reason != ""
    assert shown.verdict.first_failure == verdict.first_failure
    assert shown.path.limits.rows.prediction.waypoint.max() == verdict.first_failure
    stuck = (*[""] * (len(reasons) - 1), "the wheel is stuck")
    session.replay(again, stuck)  # which takes precedence over the model
    assert session.shown.verdict.reason == "the wheel is stuck"
    assert not session.shown.verdict.traversable
    session.change_rover(FRICTION, 0.4)
    assert len(session.shown.paths) == 1 and session.shown.scenario.rover.friction == 0.4
    assert session.shown.verdict.first_failure <= verdict.first_failure
    np.testing.assert_array_equal(session.shown.path.poses, prediction.poses)
    session.plan_to(np.array([2.5, 0.5]))
    assert len(session.shown.paths) > 1 and session.wanted.recorded is None


def test_a_replay_keeps_the_soil_the_policy_and_the_arm_it_was_predicted_with(tmp_path):
    ground = make_terrain(lambda x, y: 0.0 * x)
    angles = {"arm_yaw": 0.5}
    options = SweepOptions(
        policy="optimal", soil="dry_sand", friction=0.7, payload=0.5, joint_angles=angles
    )
    prediction, verdict = judge_path(LSR1, ground, STRAIGHT, options)
    assert verdict.max_sinkage > 0.0
    file = tmp_path / "out.npz"
    assumed = assume(LSR1, options, 2.0)
    write_prediction(file, prediction, verdict, assumptions=assumed)
    assert read_prediction(file)[2] == assumed

    session = session_on(ground, (-1.0, 0.0, 0.0), options=CANDIDATES)
    session.replay(*read_prediction(file))
    assert (session.wanted.rover.friction, session.wanted.rover.manipulator.payload) == (0.7, 0.5)
    assert session.wanted.options.model.arm_angles == angles
    session.change_rover([("wheel", "width")], 0.07)
    changed = session.shown.verdict
    assert changed.max_sinkage > verdict.max_sinkage and changed.policy == "optimal"
    assert session.wanted.options.map_sigmas == 2.0


def test_default_ends_are_on_known_ground_where_the_rover_can_stand_at_most_10_m_apart():
    ground = make_terrain(lambda x, y: np.where(np.hypot(x + 2.0, y) < 1.0, np.nan, 0.0))
    (x, y, _), goal = choose_ends(LSR1, ground)
    assert goal == pytest.approx((2.0, 0.0, 0.0))
    assert 1.0 < np.hypot(x + 2.0, y) < 2.5 and x < 0.0
    start, goal = choose_ends(LSR1, Terrain(np.zeros((1200, 1200)), 0.1, (0.0, 0.0)))
    assert np.hypot(goal[0] - start[0], goal[1] - start[1]) == pytest.approx(10.0)
    steep = choose_ends(LSR1, make_terrain(lambda x, y: 2.0 * x))  # it can stand nowhere
    assert steep == (pytest.approx((-2.0, 0.0, 0.0)), pytest.approx((2.0, 0.0, 0.0)))


def test_every_ground_has_a_name(tmp_path, monkeypatch):
    (tmp_path / "mars.zarr").mkdir()
    monkeypatch.chdir(tmp_path / "mars.zarr")
    assert name_ground(None, None) == f"made, seed {SEED}"
    assert name_ground("maps/hill.npz", None) == "hill.npz"
    assert name_ground(None, Path(".")) == name_ground(None, Path("../mars.zarr/")) == "mars.zarr"
