# SPDX-License-Identifier: Apache-2.0
"""The traverse server finds paths around obstacles over DDS, and says why there is none."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from msg_adapters.results.grids import NOT_REACHED, REACHED
from support.grounds import make_terrain, pen
from support.planner_client import SERVER, ask, verdict_of
from support.ros_fixtures import hear
from support.waiting import wait_until

INSIDE, BEYOND = (0.0, 0.0, 0.0), (2.6, 0.0, 1.57)
"""Poses inside and outside of the pen."""


def test_a_search_tells_of_its_progress_and_then_of_the_closed_area(start_server, client):
    server = start_server(
        lattice_cell=0.5, waypoint_spacing=0.1, candidate_count=1, search_budget=60.0
    )
    reports = hear(client, DiagnosticArray, f"{SERVER}/search_progress")
    wait_until(server.desk._progress.get_subscription_count, "who hears of the progress")
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
    wait_until(lambda: reports, "the first report")
    told = verdict_of(reports[0])
    assert told["found"] == "False" and float(told["cost"]) == np.inf
    assert int(told["edges_judged"]) >= 0 and float(told["seconds"]) >= 0.0
