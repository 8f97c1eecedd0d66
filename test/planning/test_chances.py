# SPDX-License-Identifier: Apache-2.0
"""Planning by chances: what is refused by its chance is gone around, and told."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.limits.table import CHANCE
from rover_planner.planning.path_query import PathQueryOptions, answer_path_query
from rover_planner.planning.search.path_search import FOUND, find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery
from support.rough_grounds import plane
from support.rovers import LSR1
from support.services import load_settings

START, GOAL = (-1.2, 0.0, 0.0), (1.2, 0.0, 0.0)
LONG = LatticeSettings(budget=60.0, cell=0.3)


@pytest.fixture(scope="module")
def slippery():
    """A slope with a patch in the middle on which friction is just enough."""
    ground = plane(0.2, 0.0, half=3.0)
    axis = ground.origin[0] + ground.resolution * np.arange(ground.elevation.shape[0])
    x, y = np.meshgrid(axis, axis)
    patch = (abs(x) < 0.5) & (abs(y) < 0.5)
    return replace(ground, friction=np.where(patch, 0.32, 0.8))


def options(accepted: float) -> PathQueryOptions:
    """Return the options of a server with these parameters."""
    return load_settings(candidate_count=1, waypoint_spacing=0.05, accepted_chance=accepted).query


def test_a_path_is_refused_by_its_chance_alone(slippery):
    plain = answer_path_query(LSR1, slippery, START, GOAL, options(1.0))
    assert plain.traversable and np.isnan(plain.chosen.verdict.failure_chance)
    refused = answer_path_query(LSR1, slippery, START, GOAL, options(0.05)).chosen.verdict
    assert refused.code == CHANCE and refused.failure_chance > 0.05
    assert refused.reason.startswith("the path passes as told, but fails with a chance of ")
    assert abs(plain.chosen.poses[refused.first_failure, 0]) < 1.0


@pytest.mark.long
def test_a_search_goes_around_what_its_chance_refuses(slippery):
    query = SearchQuery(LSR1, slippery, START, GOAL, options(0.05))
    answer = find_path(query, LatticeSettings(budget=60.0, ends_at_first=True))
    assert answer.outcome == FOUND
    assert answer.path.verdict.failure_chance <= 0.05
    assert np.abs(answer.path.poses[:, 1]).max() > 0.5


def test_a_search_goes_around_what_may_fail_if_the_weight_of_chances_pays_for_it(slippery):
    query = SearchQuery(LSR1, slippery, START, GOAL, options(1.0))
    straight = find_path(query, LONG).path
    assert np.abs(straight.poses[:, 1]).max() < 0.5
    answer = find_path(query, replace(LONG, chance_weight=50.0))
    path, chance = answer.path, answer.report()["failure_chance"]
    assert answer.outcome == FOUND and path.verdict.failure_chance == chance < 0.05
    assert np.abs(path.poses[:, 1]).max() > 0.5 and path.length > straight.length + 0.1
