# SPDX-License-Identifier: Apache-2.0
"""Tests of the search for ways around obstacles."""

from copy import deepcopy
from dataclasses import replace

import numba
import numpy as np
import pytest

from rover_physics import Terrain, judge_path, load_terrain
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search import lattice_search, path_search, query
from rover_planner.planning.search.difficulty import find_groundless
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.edges import Gear, Piece
from rover_planner.planning.search.graph import ShortestPaths, edge_cost
from rover_planner.planning.search.judge import PathJudge, cost_of_path
from rover_planner.planning.search.lattice_search import join_pieces
from rover_planner.planning.search.nodes import nodes_within
from rover_planner.planning.search.path_search import (
    FOUND,
    GOAL_REFUSED,
    NO_WAY,
    OUT_OF_TIME,
    find_path,
)
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site
from support.grounds import fractal, make_terrain, pen, plane, raised, waves
from support.paths import poses_at
from support.rovers import LSR1
from support.services import load_settings

OPTIONS = PathQueryOptions(waypoint_spacing=0.04)
LONG = LatticeSettings(budget=60.0, cell=0.25)
START, GOAL = (-2.5, 0.0, 0.0), (2.5, 0.0, 0.0)


def long_wall(x, y):
    """Return waves with a wall of 1 m along y at x = 0, open beyond y = 2."""
    return waves(x, y) + np.where((np.abs(x) < 0.1) & (y < 2.0), 1.0, 0.0)


def ask(terrain, start=START, goal=GOAL, rover=LSR1, **options):
    return SearchQuery(Site(rover, terrain, OPTIONS.change(**options)), start, goal)


@pytest.fixture(scope="module")
def around():
    """Return question and answer of a path around a wall, and what is remembered of it."""
    question, memory = ask(make_terrain(long_wall)), EdgeMemory()
    return question, find_path(question, LONG, memory), memory


def test_a_way_that_passes_leads_to_the_goal_around_a_wall_that_refuses_all_candidates(around):
    question, answer, _ = around
    assert not PathJudge(question.site).search(START, GOAL).traversable
    assert answer.outcome == FOUND and not answer.reason
    assert 0.0 < answer.seconds_first <= answer.seconds < 60.0
    poses = answer.path.poses
    assert poses[:, 1].max() > 2.0
    np.testing.assert_allclose(poses[[0, -1]], [START, GOAL], atol=1e-12)
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= OPTIONS.waypoint_spacing + 1e-9
    _, verdict = judge_path(LSR1, question.site.terrain, poses, OPTIONS.model)
    assert verdict.traversable, verdict.reason


def test_a_search_that_ends_by_itself_is_near_the_best_and_judges_few_edges(around):
    _, answer, _ = around
    assert answer.repeatable and 1.0 <= answer.suboptimality <= 1.0201
    assert 0 < answer.edges_judged < 0.1 * answer.edges and answer.warning == ""


class Compared(ShortestPaths):
    """Compares paths with what their parts cost now and, if exact, with a search from scratch."""

    steps = 0

    def __init__(self, *known):
        super().__init__(*known)
        self.known = known

    def find(self, starts, goals, caution):
        route = super().find(starts, goals, caution)
        edges, graph = self.known[0], self.graph(caution)
        anew = ShortestPaths(*self.known).find(starts, goals, 0.0) if caution == 0.0 else route
        Compared.steps += 1
        if route is None:
            assert anew is None
            return None
        cost = starts.costs[route.start] + goals.costs[route.goal]
        for edge, end in zip(route.edges, edges.ends(route.edges), strict=True):
            cost += edge_cost(graph, *divmod(int(edge), edges.width), end)
        assert [route.cost, route.cost] == pytest.approx([cost, anew.cost], abs=1e-9)
        return route


@pytest.mark.parametrize(
    ("ground", "ends", "outcome"),
    [
        (fractal(1), ((-2.0, 1.5, 0.0), (2.0, -1.5, 0.0)), FOUND),
        (make_terrain(pen, half=3.2), ((0.0, 0.0, 0.0), GOAL), NO_WAY),
    ],
    ids=["relief", "pen"],
)
def test_each_step_of_a_search_knows_all_that_was_learned_before(
    monkeypatch, ground, ends, outcome
):
    monkeypatch.setattr(lattice_search, "ShortestPaths", Compared)
    monkeypatch.setattr(Compared, "steps", 0)
    assert find_path(ask(ground, *ends), LONG).outcome == outcome
    assert Compared.steps > 20


def test_the_same_query_has_the_same_path_to_the_bit_with_any_number_of_threads(around):
    question, answer, memory = around
    threads, memory = numba.get_num_threads(), deepcopy(memory)
    try:
        numba.set_num_threads(1)
        again = find_path(question, LONG)
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(again.path.poses, answer.path.poses)
    assert (again.edges_judged, again.cost) == (answer.edges_judged, answer.cost)
    known = find_path(question, LONG, memory)  # hardly anything is judged again
    assert known.edges_judged < 0.5 * answer.edges_judged
    assert known.suboptimality <= 1.0201 and known.cost == pytest.approx(answer.cost, rel=0.03)
    assert find_path(ask(question.site.terrain, friction=0.5), LONG, memory).edges_judged > 0


def test_of_a_closed_pen_the_answer_tells_its_area_and_what_closes_it():
    ground, coarse = make_terrain(pen, half=3.2), replace(LONG, cell=0.3)
    answer = find_path(ask(ground, (0.0, 0.0, 0.0), (2.4, 0.0, 1.57)), coarse)
    assert answer.outcome == NO_WAY and answer.path is None
    closed = answer.closed
    assert not closed.around_goal and 0.0 < closed.area < 9.0
    assert sum(closed.causes.values()) == pytest.approx(1.0)
    assert not {"off_map", "unknown_ground"} & set(closed.causes)
    assert f"{closed.area:.1f} m2" in answer.reason
    rows, columns = np.nonzero(closed.places)
    cell, (column, row) = answer.nodes.cell, answer.nodes.first
    assert np.abs(cell * (columns + column)).max() < 1.6
    assert np.abs(cell * (rows + row)).max() < 1.6
    answer = find_path(ask(ground, (2.4, 0.0, 1.57), (0.0, 0.0, 0.0)), coarse)
    assert answer.outcome == NO_WAY and answer.closed.around_goal


def test_what_only_whole_paths_are_refused_for_closes_an_area_too():
    """Edges that were closed for it were open again, and all of the map was reachable."""
    ledge = make_terrain(lambda x, y: np.where(x > 0.2, -0.3, 0.0), half=1.5)
    rover = replace(LSR1, limits=replace(LSR1.limits, wheel_drop=1.0))
    question = ask(ledge, (-0.9, 0.0, 0.0), (0.8, 0.0, 0.0), rover)
    answer = find_path(question, replace(LONG, cell=0.5))
    assert answer.outcome == NO_WAY and "trapped" in answer.closed.causes
    assert answer.closed.around_goal and answer.closed.area < 4.5


def test_out_of_time_is_not_no_way():
    question = ask(make_terrain(pen), (0.0, 0.0, 0.0), (3.0, 0.0, 0.0))
    answer = find_path(question, LatticeSettings(budget=1e-3))
    assert answer.outcome == OUT_OF_TIME and answer.closed is None
    assert "0.001 s" in answer.reason


def test_a_rover_that_slips_up_a_slope_of_sand_may_back_out():
    """It was told that it cannot stand at the start."""
    slope = make_terrain(lambda x, y: 0.2 * np.maximum(x, 0.0), half=2.2)
    question = ask(slope, (1.0, 0.0, 0.0), (-0.8, 0.0, 0.0), soil="dry_sand", accepted_chance=1.0)
    ahead = judge_path(LSR1, slope, [question.start], question.site.options.model)[1]
    assert ahead.code == "friction"
    answer = find_path(question, replace(LONG, cell=0.4, ends_at_first=True))
    assert answer.outcome == FOUND and answer.path.verdict.traversable


@pytest.mark.parametrize(
    ("start", "goal", "said"),
    [
        ((-4e6 - 0.25, 0, 0), GOAL, "start is at .-4000000.25, 0., off the map, .* from x -4 to"),
        (START, (0.0, 0.0), "goal is .0.0, 0.0.; it must be three finite numbers x, y, yaw"),
    ],
)
def test_impossible_ends_and_settings_are_refused_by_name(start, goal, said):
    with pytest.raises(PlanningError, match=said):
        find_path(ask(make_terrain(waves), start, goal))
    for name, value in (("budget", np.nan), ("cell", 0.0)):
        with pytest.raises(PlanningError, match=f"{name} is {value}; it must be a finite number"):
            LatticeSettings(**{name: value})


def test_after_a_change_of_the_map_what_is_remembered_gives_the_way_of_a_new_search(around):
    question, first, memory = around
    before, memory = question.site.terrain, deepcopy(memory)
    x = before.origin[0] + before.resolution * np.arange(before.elevation.shape[1])
    longer = np.ix_((x > 1.9) & (x < 2.3), np.abs(x) < 0.1)
    after = raised(before, longer, 1.0)
    warm, cold = find_path(ask(after), LONG, memory), find_path(ask(after), LONG)
    assert not np.array_equal(first.path.poses, cold.path.poses)
    assert warm.outcome == cold.outcome == FOUND
    assert warm.cost == pytest.approx(cold.cost, rel=0.03)
    assert 0 < warm.edges_judged < cold.edges_judged
    _, verdict = judge_path(LSR1, after, warm.path.poses, OPTIONS.model)
    assert verdict.traversable


def test_the_last_way_is_the_first_path_after_a_change_of_the_map_that_it_passes(around):
    question, first, memory = around
    memory, asked = deepcopy(memory), replace(LONG, ends_at_first=True)
    after = raised(question.site.terrain, np.s_[:3], 0.02)  # far from the way
    again = find_path(ask(after), asked, memory)
    assert again.outcome == FOUND and again.expanded == 0
    np.testing.assert_array_equal(again.path.poses, first.path.poses)
    other = find_path(ask(after, goal=(2.4, 0.1, 0.0)), asked, memory)
    np.testing.assert_allclose(other.path.poses[-1], (2.4, 0.1, 0.0), atol=1e-12)


def test_where_estimates_find_no_ground_the_model_finds_none():
    """All of the map and beyond it, and where the rover stands because it tilts."""
    spirit, found = load_terrain("spirit"), 0
    whole, part = ((-51.4, -27.4), (-37.6, -14.6)), ((-47.12, -19.92), (-45.88, -19.2))
    for cell, window in ((0.25, whole), (0.04, part)):
        nodes = nodes_within(cell, *window)
        groundless = find_groundless(LSR1, spirit, nodes)
        poses = nodes.poses(np.arange(nodes.count))
        codes = np.array(PathJudge(Site(LSR1, spirit, OPTIONS)).stand(poses))
        assert set(codes[groundless]) <= {"unknown_ground", "off_map"}
        found += groundless.sum()
    assert found > 10_000


def test_only_the_heights_around_the_window_are_looked_at(monkeypatch):
    monkeypatch.setattr(query, "MAX_NODES", 150_000)
    wide = Terrain(np.zeros((600, 600), np.float32), 0.1, (-30.0, -30.0))
    question = ask(wide, (10.0, 12.0, 0.0), (14.0, 12.0, 0.0))
    nodes, is_limited = query.choose_window(question, 0.2)
    assert is_limited and nodes.count <= 150_000
    row, column = np.array(nodes.shape) / 2
    centre = nodes.cell * (nodes.first[0] + column), nodes.cell * (nodes.first[1] + row)
    np.testing.assert_allclose(centre, (12.0, 12.0), atol=0.5)
    part = query.cut_out(question.site, nodes)
    assert part.elevation.size < 0.15 * wide.elevation.size
    assert not find_groundless(LSR1, part, nodes).any()
    assert find_path(question, LONG).outcome == FOUND
    enclosed = ask(raised(wide, np.s_[:, 430], 3.0), question.start, question.goal)
    refused = find_path(enclosed, LatticeSettings(budget=0.3))
    assert refused.outcome in (OUT_OF_TIME, NO_WAY)
    assert "m around start and goal" in refused.reason


def test_a_way_to_unknown_ground_ends_at_the_frontier_if_wanted_and_at_the_goal_once_it_is_known():
    question = ask(make_terrain(lambda x, y: np.where(x > 1.475, np.nan, waves(x, y))))
    refused = find_path(question, LONG)
    assert refused.outcome == GOAL_REFUSED
    assert refused.reason == "the rover cannot stand at the goal: unknown ground under a wheel"
    memory, to_frontier = EdgeMemory(), replace(LONG, frontier=True)
    answer = find_path(question, to_frontier, memory)
    assert answer.outcome == FOUND and answer.path.verdict.traversable
    end = answer.path.poses[-1]
    left = np.hypot(*(end[:2] - GOAL[:2]))
    assert f"{left:.1f} m before it" in answer.reason
    # On level ground, a wheel of the rover that stands across the edge is 0.4 m from its middle.
    assert 1.0 < left < 1.7
    # From the same start, the old way that ends far before the goal was the answer.
    known = find_path(ask(make_terrain(waves)), replace(to_frontier, ends_at_first=True), memory)
    np.testing.assert_allclose(known.path.poses[-1], GOAL, atol=1e-9)


def test_unknown_ground_before_a_far_goal_leaves_the_budget_to_the_search(monkeypatch):
    """The model was asked about all poses on it, nearest to the goal first: there was no way."""
    monkeypatch.setattr(path_search, "POSES_PER_SECOND", 100)
    half_known = make_terrain(lambda x, y: np.where(x > -1.0, np.nan, waves(x, y)))
    answer = find_path(ask(half_known, goal=(3.9, 0.0, 0.0)), replace(LONG, frontier=True))
    assert answer.outcome == FOUND and answer.path.poses[-1, 0] > -1.7


def test_turns_on_the_spot_need_no_nodes_and_are_taken_where_they_cost_less_than_the_curve():
    """Between rocks there was no way to a goal beside the start, or a way to a node and back."""
    turn = ask(make_terrain(lambda x, y: 0.0 * x, half=2.0), (0.1, 0.07, 0.0), (0.1, 0.07, 1.2))
    answer = find_path(turn, replace(LONG, ends_at_first=True))
    assert answer.path.length == 0.0 and answer.cost < 1.0
    np.testing.assert_allclose(answer.path.poses[[0, -1]], [turn.start, turn.goal], atol=1e-12)


def test_a_lattice_coarser_than_obstacles_is_warned_of():
    coarse = find_path(ask(make_terrain(waves)), replace(LONG, cell=0.5))
    assert "cell of 0.5 m is larger than 0.40 m" in coarse.warning


def test_a_rover_that_turns_widely_reaches_a_goal_between_the_lines_of_the_lattice():
    rover = replace(LSR1, steering=replace(LSR1.steering, limit=0.2))
    question = ask(make_terrain(lambda x, y: 0.0 * x), (-1.0, 0.0, 0.0), (-1.0, 0.5, 0.0), rover)
    answer = find_path(question, replace(LONG, cell=0.2))
    assert answer.outcome == FOUND
    np.testing.assert_allclose(answer.path.poses[-1], question.goal, atol=1e-9)


@pytest.fixture(scope="module")
def slippery():
    """A slope with a patch in the middle on which friction is just enough."""
    ground = plane(0.2, 0.0, half=3.0)
    axis = ground.origin[0] + ground.resolution * np.arange(ground.elevation.shape[0])
    x, y = np.meshgrid(axis, axis)
    patch = (abs(x) < 0.5) & (abs(y) < 0.5)
    return replace(ground, friction=np.where(patch, 0.32, 0.8))


def ask_across(ground, accepted_chance):
    """Return the question of a server that leads across the middle."""
    asked = load_settings(waypoint_spacing=0.05, accepted_chance=accepted_chance).query
    return SearchQuery(Site(LSR1, ground, asked), (-1.2, 0.0, 0.0), (1.2, 0.0, 0.0))


@pytest.mark.long
def test_a_search_goes_around_what_its_chance_refuses(slippery):
    settings = LatticeSettings(budget=60.0, ends_at_first=True)
    answer = find_path(ask_across(slippery, 0.05), settings)
    assert answer.outcome == FOUND
    assert answer.path.verdict.failure_chance <= 0.05
    assert np.abs(answer.path.poses[:, 1]).max() > 0.5


def test_a_path_costs_as_much_as_its_pieces_each_in_its_gear():
    """Where chances are weighed, a path was priced as if all of it were driven forwards."""
    level, x = make_terrain(lambda x, y: 0.0 * x, half=1.5), np.linspace(-0.5, 0.5, 41)
    judge = PathJudge(Site(LSR1, level, OPTIONS.change(accepted_chance=1.0)))
    ahead = Piece(poses_at(x), Gear.FORWARD)
    pieces = [ahead, Piece(ahead.poses[::-1], Gear.BACKWARD)]
    path = judge.check(join_pieces(pieces)[0])
    alone = sum(one.cost for one in judge.judge_pieces(pieces))
    assert cost_of_path(LSR1, pieces, path) == pytest.approx(alone, rel=0.02)


def test_where_any_chance_is_accepted_a_path_that_fails_almost_for_sure_is_found(
    slippery, monkeypatch
):
    """Where chances were weighed, it was refused."""
    monkeypatch.setattr(path_search, "ASKED", 0.05)  # an almost sure failure takes long to find
    question = ask_across(replace(slippery, friction=0.0 * slippery.friction + 0.32), 1.0)
    answer = find_path(question, replace(LONG, cell=0.3, budget=8.0, chance_weight=1.0))
    assert answer.outcome == FOUND


def test_a_search_goes_around_what_may_fail_if_the_weight_of_chances_pays_for_it(slippery):
    question, coarse = ask_across(slippery, 1.0), replace(LONG, cell=0.3)
    straight = find_path(question, coarse).path
    assert np.abs(straight.poses[:, 1]).max() < 0.5
    told: list[bool] = []
    answer = find_path(
        question,
        replace(coarse, chance_weight=50.0),
        on_progress=lambda progress: told.append(progress.best is not None),
    )
    assert told == sorted(told)  # a path that was found stays so
    path, chance = answer.path, answer.report()["failure_chance"]
    assert answer.outcome == FOUND and path.verdict.failure_chance == chance < 0.05
    assert np.abs(path.poses[:, 1]).max() > 0.5 and path.length > straight.length + 0.1
