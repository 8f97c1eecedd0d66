# SPDX-License-Identifier: Apache-2.0
"""The traverse server finds paths around obstacles over DDS, and says why there is none."""

import threading

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray

from msg_adapters.results.grids import NOT_REACHED, REACHED
from support.grounds import make_terrain, pen, waves
from support.planner_client import SERVER, ask
from support.ros_fixtures import hear
from support.waiting import wait_until

INSIDE, BEYOND = (0.0, 0.0, 0.0), (2.6, 0.0, 1.57)
"""Poses inside and outside of the pen."""
LONG = {"search_budget": 60.0, "time_budget": 120.0}
"""Time enough for a busy machine."""


def test_without_a_path_the_code_says_so_and_the_closed_area_is_a_grid(start_server, client):
    start_server(lattice_cell=0.5, waypoint_spacing=0.1, candidate_count=1, **LONG)
    client.send_terrain(make_terrain(pen, half=3.5))
    plan, verdict, results = ask(client, start=INSIDE, goal=BEYOND)
    assert plan.poses == [] and verdict["code"] == "no_way"
    assert "closed in by" in verdict["reason"] and "the best candidate: " in verdict["reason"]
    grid = results["closed_area"]
    assert grid.header.stamp == results["plan"].header.stamp and grid.header.frame_id == "map"
    values = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    rows, columns = np.nonzero(values == REACHED)
    assert len(rows) > 0 and set(np.unique(values)) == {REACHED, NOT_REACHED}
    resolution, origin = grid.info.resolution, grid.info.origin.position
    for values, first in ((columns, origin.x), (rows, origin.y)):
        assert np.abs(first + resolution * (values + 0.5)).max() < 1.6


@pytest.mark.long  # the search alone is held by test/planning/answering
def test_a_search_tells_of_its_progress_and_goes_on_with_a_newer_map(start_server, client):
    start_server(lattice_cell=0.06, **LONG)  # so that it takes long
    plans, reports = [], hear(client, DiagnosticArray, f"{SERVER}/search_progress")
    client.send_terrain(make_terrain(pen))
    asking = threading.Thread(target=lambda: plans.append(client.can_traverse(INSIDE, BEYOND)))
    asking.start()
    wait_until(lambda: reports, "the first report")
    values = {entry.key: entry.value for entry in reports[0].status[0].values}
    assert values["found"] == "False" and float(values["cost"]) == np.inf
    assert int(values["edges_judged"]) >= 0 and float(values["seconds"]) >= 0.0
    client.send_terrain(make_terrain(waves))
    asking.join(60.0)
    assert plans and len(plans[0].poses) > 0
