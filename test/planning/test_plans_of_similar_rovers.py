# SPDX-License-Identifier: Apache-2.0
"""A rover of another size or gravity gets the plan of its like on ground that is alike."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.rover.model import Rover
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery
from support.rough_grounds import bouldered, enlarged, rocky
from support.rovers import LSR1, SIMILAR, similar

START, GOAL = np.array([-2.0, -1.5, 0.3]), np.array([1.8, 1.6, 0.8])
SURE = PathQueryOptions(accepted_chance=1.0)
FIRST = LatticeSettings(budget=200.0, ends_at_first=True)


def plan(rover: Rover, seed: int):
    """Yield what is told of a search and of candidates, without units."""
    size = rover.wheel.radius / LSR1.wheel.radius
    units = [size, size, 1.0]
    found = find_path(
        SearchQuery(rover, enlarged(bouldered(seed), size), START * units, GOAL * units, SURE),
        FIRST,
    )
    yield found.outcome, found.expanded, found.edges_judged, found.cost / size
    yield None if found.path is None else found.path.poses / units
    judge = PathJudge(rover, enlarged(rocky(seed), size), SURE)
    answer = judge.search(START * units, GOAL * units, 0.35 * size)
    yield answer.nearest, answer.alternatives_tried, answer.goal_offset / size
    for candidate in answer.candidates:
        yield candidate.verdict.codes
        yield candidate.poses / units


@pytest.mark.parametrize("like", SIMILAR)
def test_similar_rovers_get_the_same_plan_to_the_bit(like):
    there = plan(similar(LSR1, *SIMILAR[like]), 4)
    for expected, found in zip(plan(LSR1, 4), there, strict=True):
        np.testing.assert_equal(found, expected)


def test_distances_of_the_server_follow_from_the_rover_unless_they_are_told():
    parameters = TraverseServerParameters()
    own = load_service_settings(parameters)
    lengths = own.query.spacing, own.query.waypoint_spacing, own.monitor_offset
    assert lengths == (0.3, 0.02, 0.5)
    large = load_service_settings(replace(parameters, rover="m2020"))
    ratio = large.rover.wheel.radius / own.rover.wheel.radius
    lengths = large.query.spacing, large.query.waypoint_spacing, large.monitor_offset
    assert lengths == pytest.approx((0.3 * ratio, 0.02 * ratio, 0.5 * ratio))
    told = replace(
        parameters, rover="m2020", waypoint_spacing=0.04, candidate_spacing=0.5, monitor_offset=1.0
    )
    settings = load_service_settings(told)
    lengths = settings.query.spacing, settings.query.waypoint_spacing, settings.monitor_offset
    assert lengths == (0.5, 0.04, 1.0)
