# SPDX-License-Identifier: Apache-2.0
"""Searches keep out of marked places until these are cleared, and off ground never seen."""

import json
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from rover_physics import Terrain, load_rover
from rover_planner.errors import PlanningError
from rover_planner.maps.unobserved_ground import (
    ALLOW_FOOTPRINT,
    ASSUMED,
    REFUSE,
    ObservedGround,
    observed_ground,
)
from rover_planner.parameters.traverse_server import AUTO, LATTICE
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.planning.learned_ground import parse_learned
from rover_planner.planning.marked_places import (
    MARKED_CODE,
    NONE_MARKED,
    MarkedPlace,
    MarkedPlaces,
    parse_place,
)
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import GOAL_REFUSED, START_REFUSED, find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site
from support.grounds import make_terrain, plane
from support.paths import poses_at
from support.services import make_service

PLACE = MarkedPlace(1.5, 0.0, 0.4, "wheels turn and the rover stays", "2026-11-25 04:00:00 UTC")
START, GOAL = (0.0, 0.0, 0.0), (3.0, 0.0, 0.0)


def test_until_it_is_cleared_a_marked_place_refuses_paths_and_answers_lead_around_it():
    service = make_service(plane(0.0, 0.0, half=4.0), planner=AUTO, search_budget=60.0)
    service.mark(PLACE)
    service.given_path = GivenPath(poses_at(np.linspace(0.0, 3.0, 40)), "")
    judged = service.given_path.judge(service.snapshot())
    assert judged.code == MARKED_CODE
    assert PLACE.reason in judged.reason and PLACE.date in judged.reason
    rim = judged.candidate.poses[judged.candidate.verdict.first_failure]
    assert rim[0] == pytest.approx(PLACE.x - PLACE.radius, abs=0.1)
    judged = service.snapshot().answer(START, GOAL)
    assert judged.traversable, judged.reason
    away = np.hypot(judged.candidate.poses[:, 0] - PLACE.x, judged.candidate.poses[:, 1])
    assert away.min() >= PLACE.radius
    assert judged.candidate.verdict.failure_chance == 0.0  # it is asked of this path, too
    service.marked = NONE_MARKED
    assert np.abs(service.snapshot().answer(START, GOAL).candidate.poses[:, 1]).max() < 0.05


def test_a_search_is_told_at_once_that_its_goal_is_in_a_marked_place():
    """It looked at all edges around it, and told that there is no way."""
    service = make_service(plane(0.0, 0.0, half=2.5), planner=LATTICE)
    service.mark(PLACE)
    judged = service.snapshot().answer(START, (PLACE.x, PLACE.y, 0.0))
    assert judged.code == GOAL_REFUSED and PLACE.reason in judged.reason


def test_a_search_to_the_frontier_ends_outside_a_marked_place():
    """All that was offered lay in the place, and there was no way."""
    unseen = make_terrain(lambda x, y: np.where(x > 0.5, np.nan, 0.0 * x), half=2.5)
    service = make_service(
        unseen, planner=LATTICE, search_frontier=True, lattice_cell=0.25, search_budget=60.0
    )
    service.mark(replace(PLACE, x=0.2, radius=1.5))
    judged = service.snapshot().answer((-1.8, 0.0, 0.0), (2.0, 0.0, 0.0))
    assert judged.traversable, judged.reason
    assert np.hypot(*(judged.candidate.poses[-1][:2] - (0.2, 0.0))) >= 1.5


@pytest.mark.parametrize("planner", [AUTO, LATTICE])
def test_a_search_ends_near_a_goal_where_the_rover_cannot_stand(planner):
    """Behind a wall that refuses all candidates, the goal itself was refused."""

    def wall_and_rock(x, y):
        wall = (np.abs(x) < 0.1) & (np.abs(y) < 1.2)
        return np.where(wall | (np.hypot(x - 1.6, y) < 0.3), 1.0, 0.0)

    walled = make_terrain(wall_and_rock, half=3.0)
    service = make_service(walled, planner=planner, lattice_cell=0.25, search_budget=60.0)
    asked = (-1.6, 0.0, 0.0), (1.6, 0.0, 0.0)
    assert not service.snapshot().answer(*asked).traversable
    judged = service.snapshot().answer(*asked, tolerance=1.0)
    assert judged.traversable, judged.reason
    assert 0.3 < judged.search.goal_offset <= 1.0


def test_a_rover_may_leave_a_place_but_not_go_on_into_it():
    marked = MarkedPlaces((PLACE,))
    ends = (1.3, 0.5), (1.3, 1.4), (1.6, 2.5), (1.3, 1.3)
    pieces = [poses_at(np.linspace(*both, 40)) for both in ends]
    assert marked.refuses(pieces).tolist() == [False, True, False, False]


def test_of_many_places_only_those_that_a_path_may_reach_are_looked_at():
    places = tuple(replace(PLACE, x=float(x)) for x in range(1000))
    path, away = poses_at(np.linspace(4.5, 6.5, 40)), MarkedPlace.away
    with patch.object(MarkedPlace, "away", autospec=True, side_effect=away) as look:
        assert MarkedPlaces(places).find(path) == (2, places[5])
    assert {call.args[0] for call in look.mock_calls} == set(places[5:7])


@pytest.mark.parametrize("change", [{"radius": -1.0}, {"x": None}, {"x": float("inf")}])
def test_what_is_no_place_is_refused(change):
    text = json.dumps(vars(PLACE) | change)
    with pytest.raises(PlanningError, match="radius"):
        parse_place(text, "a test")


@pytest.mark.parametrize("parse", [parse_place, parse_learned])
def test_text_that_is_nested_without_end_is_refused(parse):
    with pytest.raises(PlanningError, match="a test"):
        parse("[" * 100_000, "a test")


def flat_with_hole() -> Terrain:
    """Return level ground with unseen cells that pass between the wheels of a straight drive."""
    x, y = np.meshgrid(np.arange(-1.0, 4.01, 0.05), np.arange(-2.0, 2.01, 0.05))
    hole = (np.abs(x - 1.5) < 0.31) & (np.abs(y) < 0.06)
    return Terrain(np.where(hole, np.nan, 0.0), 0.05, (-1.0, -2.0))


def test_goals_near_a_goal_are_over_seen_ground_and_outside_marked_places():
    ground, rover, hole = flat_with_hole(), load_rover("lsr1"), np.array([1.5, 0.0, 0.0])
    seen = observed_ground(ground, None)
    marked = MarkedPlaces((replace(PLACE, x=2.4, radius=0.4),))
    options = PathQueryOptions(accepted_chance=1.0)
    judge = PathJudge(Site(rover, ground, options, seen, REFUSE, marked))
    rings = judge.goals_near(np.array(START), hole, 0.8)
    goals = np.array([goal for ring in rings for goal in ring])
    assert 8 < len(goals) < 32
    assert not seen.refused_below(rover, goals, REFUSE).any()
    assert np.hypot(*(goals[:, :2] - (2.4, 0.0)).T).min() >= 0.4


def test_a_search_leads_around_ground_never_seen_until_it_is_seen():
    memory, ground, rover = EdgeMemory(), flat_with_hole(), load_rover("lsr1")
    unseen = observed_ground(ground, None)
    kinds = np.where(unseen.kinds == 0, 0, ASSUMED).astype(np.uint8)
    filled = ObservedGround(unseen.terrain, kinds)

    def search(seen: ObservedGround, rule=ALLOW_FOOTPRINT, start=START):
        options = PathQueryOptions(waypoint_spacing=0.04)
        site = Site(rover, ground, options, seen, rule)
        return find_path(SearchQuery(site, start, GOAL), LatticeSettings(budget=60.0), memory)

    around, warm = search(unseen).path.poses, search(filled).path.poses
    assert np.abs(around[:, 1]).max() > 0.2 and np.abs(warm[:, 1]).max() < 0.05
    assert unseen.share(rover, around).unobserved_share == 0.0
    refused = search(filled, REFUSE, start=(1.5, 0.0, 0.0))
    assert refused.outcome == START_REFUSED
    assert "never seen (blind_ground is refuse)" in refused.reason
