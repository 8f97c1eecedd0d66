# SPDX-License-Identifier: Apache-2.0
"""The service knows a map, a path and joint angles, and answers from them without ROS."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from rover_physics.errors import ModelError
from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.errors import PlanningError
from rover_planner.planning.answering.questions import Register
from rover_planner.planning.answering.snapshot import GivenPath, NewerMapError, SearchWatch
from rover_planner.planning.learned_ground import LearnedGround
from rover_planner.planning.path_geometry import densify
from support.grounds import make_terrain, raised, wall_at, waves, with_std
from support.rovers import LSR1
from support.services import load_settings, make_service

FAN = {"planner": "fan", "candidate_count": 1}
"""Parameters of a service that does not search."""


def test_an_uncertain_map_is_judged_by_its_bounds_as_the_settings_say():
    start, goal = (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)
    service = make_service(with_std(make_terrain(waves), 0.005), **FAN)
    judged = service.snapshot().answer(start, goal)
    assert judged.candidate.verdict.risk > 1.0  # that of the bounds
    refused = judged.report
    assert not refused["traversable"]
    assert refused["reason"].endswith("at worst within 3 sigma of the map")
    assert refused["map_sigmas"] == 3.0
    service.settings = load_settings(map_sigmas=0.0, **FAN)
    passed = service.snapshot().answer(start, goal).report
    assert passed["traversable"] and passed["map_sigmas"] == 0.0


def test_a_goal_far_off_the_map_costs_no_more_than_the_way_to_its_edge():
    """All of the way was judged, and its classes: seconds, up to the time budget."""
    service = make_service(make_terrain(waves))
    judged = service.snapshot().answer((0.0, 0.0, 0.0), (900.0, 0.0, 0.0))
    whole = judged.complete()
    assert whole.code == "off_map" and whole.report["reason"]
    assert len(whole.candidate.prediction.poses) < 0.01 * len(whole.candidate.poses)
    assert whole.classes == ()


@pytest.mark.parametrize("planner", ["auto", "lattice"])
def test_a_goal_off_the_map_has_a_way_to_the_frontier_if_that_is_wanted(planner):
    wanted = {"search_frontier": True, "lattice_cell": 0.25, "search_budget": 60.0}
    service = make_service(make_terrain(waves, 0.1, 2.0), planner=planner, **wanted)
    start, goal = (-1.0, 0.0, 0.0), (2.5, 0.0, 0.0)
    judged = service.snapshot().answer(start, goal)
    assert judged.traversable and 0.5 < judged.search.goal_offset < 1.5
    assert service.snapshot().answer(goal, start).code in ("off_map", "unknown_ground")


def friction_used(service):
    """Return the largest use of friction on a path."""
    service.given_path = GivenPath(np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), "")
    return float(
        service.given_path.judge(service.snapshot()).candidate.verdict.max_friction_utilisation
    )


@pytest.mark.parametrize(
    ("learn", "is_bounded", "assumed"),
    [
        ("use", True, 0.4),
        ("use", False, 0.8),  # nothing slipped: what was told holds
        ("suggest", True, 0.8),
        ("off", True, 0.8),
    ],
)
def test_a_learned_friction_changes_new_questions_only_if_it_is_to_be_used(
    learn, is_bounded, assumed
):
    service = make_service(make_terrain(waves), learn=learn)
    before = service.snapshot()
    told = friction_used(service)
    service.take_ground(LearnedGround(0.4, 0.04, 0.33, is_bounded, "12.5"))
    assert friction_used(service) == pytest.approx(0.8 / assumed * told, rel=1e-6)
    assert before.settings.rover.friction == 0.8
    report = asdict(Register().identify("check_path", GivenPath(), service.snapshot()))
    assert report["ground"] == ("learned" if learn == "use" else "told")
    known = {"off": math.nan}.get(learn, 0.4)
    assert report["ground_friction"] == pytest.approx(known, nan_ok=True)
    assert report["ground_since"] == ("" if learn == "off" else "12.5")


@pytest.mark.parametrize(("is_bounded", "spread"), [(False, 0.1), (True, 0.05)])
def test_a_friction_that_was_not_measured_is_as_uncertain_as_the_told_one(is_bounded, spread):
    learned = LearnedGround(0.8, 0.04, 0.0, is_bounded).change(LSR1)
    assert learned.uncertainty.friction == pytest.approx(spread)


def test_what_was_learned_on_a_class_of_ground_holds_for_all_of_it():
    flat = make_terrain(waves)
    shape = flat.elevation.shape
    grip = LearnedGround(0.9, 0.2, 0.1, is_bounded=False)
    classes = {1: LearnedGround(0.4, 0.02, 0.36, is_bounded=True), 2: grip}
    ground = LearnedGround(0.5, 0.05, 0.4, True, "12.5", classes)

    def learned_on(number, **layers):
        terrain = replace(flat, ground_class=np.full(shape, float(number)), **layers)
        service = make_service(terrain, learn="use")
        service.take_ground(ground)
        return service

    told = friction_used(make_service(flat))
    service = learned_on(1)
    laid = service.snapshot().known_map
    assert service.snapshot().known_map is laid  # packed once
    service.take_terrain(replace(laid.received))  # the same map once more
    assert service.snapshot().terrain is laid.terrain
    identity = Register().identify("check_path", GivenPath(), service.snapshot())
    assert identity.ground_classes == {"1": 0.4}
    # On class 2 nothing slipped, and on class 3 no wheel was.
    for number, friction in {1: 0.4, 2: 0.8, 3: 0.8, np.nan: 0.5}.items():
        used = friction_used(learned_on(number))
        assert used == pytest.approx(0.8 / friction * told, rel=1e-6)
    own = learned_on(1, friction=np.full(shape, 0.6))
    assert friction_used(own) == pytest.approx(0.8 / 0.6 * told, rel=1e-6)


def test_gaps_are_filled_or_not_as_the_settings_say_even_afterwards():
    service = make_service(raised(make_terrain(waves), (80, 80), np.nan))
    assert np.isnan(service.terrain.elevation[80, 80])
    service.settings = load_settings(unknown_cells="interpolate")
    service.refresh_map()
    assert np.isfinite(service.terrain.elevation[80, 80])
    service.settings = load_settings()
    service.refresh_map()
    assert np.isnan(service.terrain.elevation[80, 80])


def test_an_impossible_tolerance_and_a_payload_without_an_arm_are_refused():
    with pytest.raises(ModelError, match="no manipulator"):
        load_settings(rover="m2020", payload=3.0)
    for tolerance in (-0.1, math.nan, math.inf):
        with pytest.raises(PlanningError, match="tolerance is"):
            make_service().snapshot().answer((0, 0, 0), (1, 0, 0), tolerance)


def test_the_measured_suspension_is_compared_with_the_predicted_one_where_the_rover_stands():
    service = make_service(make_terrain(waves))
    service.given_path = GivenPath(np.array([[0.0, 0.0, 0.3], [1.0, 0.3, 0.3]]), "")
    free = service.given_path.judge(service.snapshot())
    assert free.suspension is None and "suspension_mismatch" not in free.report
    prediction = free.candidate.prediction
    angles = [*prediction.rocker_angle[0], *prediction.bogie_angle[0]]
    predicted = dict(zip(SUSPENSION_JOINTS, angles, strict=True))
    assert abs(predicted["rocker_left"]) > 0.001
    service.take_joints(predicted)
    assert (
        service.given_path.judge(service.snapshot()).suspension is None
    )  # where it stands is not known
    service.given_path = GivenPath(np.array([[0.5, 0.15, 0.3], [1.0, 0.3, 0.3]]), "")
    for bogie_left in (0.0, 0.2):
        service.take_joints({"bogie_left": predicted["bogie_left"] + bogie_left})
        service.take_pose(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3]))
        judgement = service.given_path.judge(service.snapshot())
        expected = dict.fromkeys(SUSPENSION_JOINTS, 0.0) | {"bogie_left": bogie_left}
        assert judgement.suspension.suspension_mismatch == pytest.approx(expected)
        assert judgement.traversable
        assert judgement.report["suspension_agrees"] == (bogie_left <= 0.0)


def test_the_arm_moves_the_balance_once_all_its_joints_are_known():
    service = make_service(make_terrain(waves))
    service.given_path = GivenPath(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), "")

    def find_loads():
        return service.given_path.judge(service.snapshot()).candidate.prediction.wheel_loads

    stowed, joints = find_loads(), service.settings.rover.manipulator.joints
    service.take_joints({joints[0]: 0.0})
    np.testing.assert_array_equal(find_loads(), stowed)
    service.take_joints(dict.fromkeys(joints, 0.0))
    moved = find_loads()
    assert np.abs(moved - stowed).max() > 0.05
    assert moved[:, [2, 5]].sum() > stowed[:, [2, 5]].sum()


def test_densify_keeps_the_given_poses_and_the_spacing_and_refuses_an_endless_path():
    poses = np.array([[0.0, 0.0, 3.0], [0.1, 0.0, -3.0], [0.1, 0.0, 0.0], [0.1, 0.05, 0.0]])
    dense, next_given = densify(poses, 0.02)
    assert len(dense) == 5 + 1 + 3 + 1
    assert np.hypot(*np.diff(dense[:, :2], axis=0).T).max() <= 0.02 + 1e-12
    for pose in poses:
        assert np.isclose(dense, pose).all(axis=1).any()
    assert next_given.tolist() == [0, 1, 1, 1, 1, 1, 2, 3, 3, 3]
    turned = np.abs(np.diff(np.unwrap(dense[:6, 2])))
    np.testing.assert_allclose(turned, (2 * math.pi - 6.0) / 5)
    with pytest.raises(PlanningError, match="more than 100000 waypoints"):
        densify(np.array([[0.0, 0.0, 0.0], [1e300, 0.0, 0.0]]), 0.02)


def test_a_changed_map_ends_a_search_while_there_is_patience():
    ground, start, goal = make_terrain(wall_at(0.0)), (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)
    service, reports = make_service(ground, planner="lattice", search_budget=60.0), []
    newer = raised(ground, ..., 0.01)
    maps = [service.known_map]

    def look_and_change(report):
        reports.append(report)
        service.take_terrain(newer)
        maps.append(service.known_map)

    watched = replace(
        service.snapshot(), watch=SearchWatch(lambda: maps[-1], look_and_change, 60.0)
    )
    with pytest.raises(NewerMapError):
        watched.answer(start, goal)
    assert len(reports) == 1 and not reports[0]["found"] and reports[0]["cost"] == math.inf
    impatient = SearchWatch(lambda: maps[-1], reports.append, 0.0)
    answer = replace(watched, watch=impatient).answer(start, goal)
    assert answer.code == "no_way" and len(reports) > 1
