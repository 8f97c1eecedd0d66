# SPDX-License-Identifier: Apache-2.0
"""The query sweeps the candidates, chooses by risk and then energy, and explains a refusal."""

from dataclasses import replace

import numpy as np
import pytest

from rover_planner.planning.path_query import PathQueryOptions, choose, generate_paths
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.query import Site
from support.grounds import make_terrain, rocky
from support.rovers import LSR1

COARSE = PathQueryOptions(count=5, spacing=0.4, waypoint_spacing=0.1)
FLAT = make_terrain(lambda x, y: 0.0 * x)


def test_a_ridge_across_all_candidates_is_refused_with_its_reason():
    terrain = make_terrain(lambda x, y: np.where(np.abs(x - 1) < 0.3, 1.0, 0.0))
    answer = PathJudge(Site(LSR1, terrain, COARSE)).search((-3, 0, 0), (3, 0, 0))
    assert not answer.traversable
    assert answer.chosen.verdict.reason
    assert answer.chosen.verdict.reason in answer.explain()
    best = max(candidate.passable_share for candidate in answer.candidates)
    assert 0 < answer.chosen.passable_share == best < 1


def test_a_goal_in_a_pit_is_answered_near_it():
    pit = make_terrain(lambda x, y: -1.0 * ((abs(x - 2.0) < 0.4) & (abs(y) < 0.6)))
    answer = PathJudge(Site(LSR1, pit, COARSE)).search((-1, 0, 0), (1.7, 0, 0), tolerance=1.0)
    assert answer.traversable and 0.2 < answer.goal_offset <= 1.0


@pytest.mark.parametrize("friction", [0.3, 0.8])
def test_the_chosen_path_is_judged_at_all_its_waypoints(friction):
    options = PathQueryOptions(accepted_chance=1.0).change(friction=friction)
    site = Site(LSR1, rocky(41), options)
    answer = PathJudge(site).search((-1.5, -1.0, 0.5), (1.5, 1.0, 0.5))
    every = generate_paths(LSR1, (-1.5, -1.0, 0.5), (1.5, 1.0, 0.5), site.options)
    np.testing.assert_array_equal(answer.chosen.poses, every[answer.choice])
    alone = PathJudge(site).check(every[answer.choice], stop_at_failure=True)
    assert answer.chosen.verdict == alone.verdict
    assert min(len(one.poses) for one in answer.candidates) < 0.6 * len(alone.poses)


def test_turns_on_the_spot_before_a_failure_are_no_distance():
    turn = np.column_stack([np.zeros((60, 2)), np.linspace(-1.0, 0.0, 60)])
    drive = np.column_stack([np.linspace(0.0, 2.0, 60), np.zeros((60, 2))])
    wall = make_terrain(lambda x, y: np.where(x > 1.3, 1.0, 0.0))
    refused = PathJudge(Site(LSR1, wall)).check(np.concatenate([turn, drive]))
    failure = drive[refused.verdict.first_failure - 60]
    assert refused.passable_length == pytest.approx(failure[0], abs=1e-9)


def test_the_safer_path_wins_and_energy_decides_between_equals():
    answer = PathJudge(Site(LSR1, FLAT, COARSE)).search((-2, 0, 0), (2, 0, 0))
    assert answer.choice == 0 and "5 of 5" in answer.explain()  # straight ahead

    def change(one, risk, energy):
        prediction = one.prediction.change(energy=np.full(len(one.poses), energy))
        return replace(one, prediction=prediction, verdict=replace(one.verdict, risk=risk))

    values = zip(answer.candidates, (0.5, 0.3, 0.31), (10.0, 90.0, 80.0), strict=False)
    risky, safe, thrifty = (change(*one) for one in values)
    assert choose((risky, safe, thrifty)).choice == 2
    refused = replace(thrifty, verdict=replace(thrifty.verdict, traversable=False))
    assert choose((risky, safe, refused)).choice == 1
