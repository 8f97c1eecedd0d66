# SPDX-License-Identifier: Apache-2.0
"""A rover of another size or gravity gets the plan of its like on ground that is alike."""

import numpy as np
import pytest

from rover_physics.rover.model import Rover
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site
from support.grounds import bouldered, enlarged, rocky, scaled_for
from support.rovers import LSR1, M2020, SIMILAR, similar
from support.services import load_settings

ENDS = np.array([[-2.0, -1.5, 0.3], [1.8, 1.6, 0.8]])
SURE = PathQueryOptions(accepted_chance=1.0)
FIRST = LatticeSettings(budget=200.0, ends_at_first=True)


def plan(rover: Rover, seed: int):
    """Yield what is told of a search and of candidates, without units."""
    size = rover.wheel.radius / LSR1.wheel.radius
    units = [size, size, 1.0]
    ground, ends = scaled_for(rover, bouldered(seed), ENDS)
    found = find_path(SearchQuery(Site(rover, ground, SURE), *ends), FIRST)
    yield found.outcome, found.expanded, found.edges_judged, found.cost / size
    yield None if found.path is None else found.path.poses / units
    judge = PathJudge(Site(rover, enlarged(rocky(seed), size), SURE))
    answer = judge.search(*ends, 0.35 * size)
    yield answer.choice, answer.alternatives_tried, answer.goal_offset / size
    for candidate in answer.candidates:
        yield candidate.verdict.codes
        yield candidate.poses / units


@pytest.mark.parametrize("like", SIMILAR)
def test_similar_rovers_get_the_same_plan_to_the_bit(like):
    there = plan(similar(LSR1, *SIMILAR[like]), 4)
    for expected, found in zip(plan(LSR1, 4), there, strict=True):
        np.testing.assert_equal(found, expected)


def test_distances_of_the_server_follow_from_the_rover_unless_they_are_told():
    def distances(**parameters):
        settings = load_settings(**parameters)
        return settings.query.spacing, settings.query.waypoint_spacing, settings.monitor_offset

    ratio = M2020.wheel.radius / LSR1.wheel.radius
    assert distances(rover="m2020") == pytest.approx(tuple(ratio * one for one in distances()))
    told = {"candidate_spacing": 0.5, "waypoint_spacing": 0.04, "monitor_offset": 1.0}
    assert distances(rover="m2020", **told) == tuple(told.values())
