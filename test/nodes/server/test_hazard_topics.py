# SPDX-License-Identifier: Apache-2.0
"""The hazard map over real DDS: latched, followed by changes, and the same as the service's."""

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap

from msg_adapters.results.grids import VALUES
from rover_planner.nodes.navigation.hazard_topics import HazardTopics
from rover_planner.ros.qos import LATCHED_QOS
from support.grounds import make_terrain, raised, waves
from support.planner_client import SERVER
from support.ros_fixtures import call, hear
from support.waiting import wait_until

PASSABLE, _, _, IMPASSABLE, UNKNOWN = VALUES.tolist()
THERE = (1.5, 2.5), (1.5, 2.5)
"""Part of the map where a rock will be [m]."""
FREE = make_terrain(waves, half=3.0, resolution=0.1)
BLOCKED = raised(FREE, np.s_[48:53, 48:53], 0.5)
"""Ground without and with a rock of 0.5 m at (2, 2)."""


def hear_grids(client, *names):
    """Return lists that get the grids which are published from now on, by name of the topic."""
    topics = (f"{SERVER}/hazard_map/{name}" for name in names)
    return [hear(client, OccupancyGrid, topic, LATCHED_QOS) for topic in topics]


def cells(grid, x=(-1.0, 1.0), y=(-1.0, 1.0)):
    """Return the values of the cells in a part of the map [m]; the map may reach beyond."""
    values = np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width)
    cell, corner = grid.info.resolution, grid.info.origin.position
    rows, columns = (
        slice(*(round((end - first) / cell) for end in ends))
        for ends, first in ((y, corner.y), (x, corner.x))
    )
    return values[rows, columns]


def is_free(grids):
    return bool(grids) and (cells(grids[-1]) == PASSABLE).all()


def has_rock(grids):
    """Return whether a rock at (2, 2) is shown."""
    return (cells(grids[-1], *THERE) == IMPASSABLE).any()


def ask_for_grid(client):
    ask = client.create_client(GetMap, f"{SERVER}/get_hazard_map")
    return call(ask, GetMap.Request()).map


@pytest.fixture
def mapping(start_server, client):
    server = start_server(hazard_map=True, hazard_headings=2)
    client.send_terrain(FREE)
    return server


def test_a_late_subscriber_gets_the_map_and_what_changes_it(mapping, client):
    worst, best, first = hear_grids(client, "worst", "best", "heading_1")
    for grids in (worst, best, first):
        wait_until(lambda grids=grids: is_free(grids), "the whole map", 60.0)
    grid, terrain = worst[-1], mapping.service.terrain
    assert grid.header.frame_id == "map"
    assert (grid.info.height, grid.info.width) == terrain.elevation.shape
    assert grid.info.origin.position.x == pytest.approx(terrain.origin[0] - 0.05)
    assert (cells(grid, y=(-3.0, -2.9)) == UNKNOWN).all()  # wheels would leave the known ground
    wait_until(lambda: ask_for_grid(client).data == worst[-1].data, "it from the service")
    client.send_terrain(BLOCKED)
    for grids in (worst, best):
        wait_until(lambda grids=grids: has_rock(grids), "the rock", 60.0)
        assert is_free(grids)  # away from it


def test_switched_off_no_cell_is_free_and_switched_on_none_of_what_was_judged_before(
    mapping, client, hold
):
    worst, first = hear_grids(client, "worst", "heading_1")
    wait_until(lambda: is_free(worst) and is_free(first), "the map", 60.0)
    judged, go_on = hold(HazardTopics, "_show")
    client.send_terrain(raised(FREE, np.s_[:], 0.001))
    assert judged.wait(60.0), "the classes on the second map"
    assert client.set_parameter("hazard_map", False)[0]
    for grids in (worst, first):
        wait_until(lambda grids=grids: set(grids[-1].data) == {UNKNOWN}, "the withdrawal")
    assert ask_for_grid(client).info.width == 0
    client.wait_for_log("get_hazard_map: an empty grid, the parameter hazard_map is false")
    client.send_terrain(BLOCKED)
    assert client.set_parameter("hazard_map", True)[0]
    before = len(worst)
    go_on.set()
    wait_until(lambda: has_rock(worst), "the third map", 60.0)
    assert not any((cells(grid, *THERE) == PASSABLE).all() for grid in worst[before:])
