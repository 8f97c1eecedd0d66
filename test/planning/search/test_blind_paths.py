# SPDX-License-Identifier: Apache-2.0
"""The search for ways keeps to the rule about ground under the belly that was never seen."""

import numpy as np

from rover_physics import Terrain, load_rover
from rover_planner.maps.unobserved_ground import ASSUMED, ObservedGround, observed_ground
from rover_planner.parameters.traverse_server import (
    ALLOW_FOOTPRINT,
    LATTICE,
    REFUSE,
    TraverseServerParameters,
)
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.path_search import START_REFUSED, find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery
from rover_planner.planning.search.unobserved_check import UnobservedCheck

LSR1 = load_rover("lsr1")
OPTIONS = PathQueryOptions(waypoint_spacing=0.04)
LONG = LatticeSettings(budget=60.0)
START, GOAL = (0.0, 0.0, 0.0), (3.0, 0.0, 0.0)


def flat_with_hole() -> Terrain:
    """Return level ground with unseen cells that pass between the wheels of a straight drive."""
    x, y = np.meshgrid(np.arange(-1.0, 4.01, 0.05), np.arange(-2.0, 2.01, 0.05))
    hole = (np.abs(x - 1.5) < 0.31) & (np.abs(y) < 0.06)
    return Terrain(np.where(hole, np.nan, 0.0), 0.05, (-1.0, -2.0))


def ask(rule: str, seen: ObservedGround | None = None, start=START) -> SearchQuery:
    ground = flat_with_hole()
    check = UnobservedCheck(LSR1, seen or observed_ground(ground, None), rule)
    return SearchQuery(LSR1, ground, start, GOAL, OPTIONS, check)


def test_a_search_leads_around_what_the_rule_refuses():
    rule = REFUSE
    service = TraverseService(
        load_service_settings(
            TraverseServerParameters(
                planner=LATTICE, blind_ground=rule, search_budget=60.0, waypoint_spacing=0.04
            )
        )
    )
    service.take_terrain(flat_with_hole())
    judged = service.answer(START, GOAL)
    assert judged.traversable, judged.reason
    poses = judged.candidate.poses
    assert np.abs(poses[:, 1]).max() > 0.2
    share = observed_ground(flat_with_hole(), None).share(LSR1, poses)
    assert share.unobserved_share == 0.0 and share.first_refused(rule) == -1


def test_what_is_seen_later_is_judged_anew():
    memory, seen = EdgeMemory(), observed_ground(flat_with_hole(), None)
    around = find_path(ask(ALLOW_FOOTPRINT), LONG, memory)
    kinds = np.where(seen.kinds == 0, 0, ASSUMED).astype(np.uint8)
    filled = ObservedGround(seen.terrain, kinds)
    warm = find_path(ask(ALLOW_FOOTPRINT, filled), LONG, memory)
    assert np.abs(around.path.poses[:, 1]).max() > 0.2
    assert np.abs(warm.path.poses[:, 1]).max() < 0.05
    refused = find_path(ask(REFUSE, filled, start=(1.5, 0.0, 0.0)), LONG, memory)
    assert refused.outcome == START_REFUSED
    assert "never seen (blind_ground is refuse)" in refused.reason
