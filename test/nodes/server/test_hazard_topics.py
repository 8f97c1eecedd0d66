"""The hazard map over real DDS: latched, followed by changes, and the same as the service's."""

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap
from rclpy.node import Node

from msg_adapters.results.hazard_grids import VALUES
from rover_planner.ros.qos import latched_qos
from support.grounds import make_terrain, waves
from support.planner_client import SERVER
from support.ros_fixtures import call, wait_until

PASSABLE, IMPASSABLE, UNKNOWN = VALUES[0], VALUES[-1], -1


def slope_and_rock(x, y):
    """Return waves with a rock of 0.5 m at (2, 2)."""
    return waves(x, y) + 0.5 * ((abs(x - 2.0) < 0.3) & (abs(y - 2.0) < 0.3))


class Costmap(Node):
    """A subscriber such as the static layer of a costmap."""

    def __init__(self, ros, names):
        super().__init__("costmap", context=ros.context)
        self.grids: dict[str, list[OccupancyGrid]] = {name: [] for name in names}
        for name, heard in self.grids.items():
            self.create_subscription(
                OccupancyGrid, f"{SERVER}/hazard_map/{name}", heard.append, latched_qos()
            )
        self.ask = self.create_client(GetMap, f"{SERVER}/get_hazard_map")


def cells(grid):
    return np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width)


@pytest.fixture
def mapping(start_server, client):
    server = start_server(hazard_map=True, hazard_headings=4)
    client.send_terrain(make_terrain(waves, half=3.0))
    return server


def test_a_late_subscriber_gets_worst_best_and_one_heading(mapping, client, ros):
    costmap = ros.spin(Costmap(ros, ("worst", "best", "heading_1")))
    wait_until(lambda: all(costmap.grids.values()), "the grids", 60.0)

    def is_whole():
        return (cells(costmap.grids["worst"][-1])[40:80, 40:80] == PASSABLE).all()

    wait_until(is_whole, "the whole map", 60.0)
    grid = costmap.grids["worst"][-1]
    assert grid.header.frame_id == "map" and grid.info.resolution == pytest.approx(0.05)
    assert grid.info.origin.position.x == pytest.approx(-3.0 - 0.025)
    worst, best = cells(grid), cells(costmap.grids["best"][-1])
    assert worst.shape == best.shape == (121, 121)
    assert (worst[:3] == UNKNOWN).all()  # wheels would leave the map
    wait_until(
        lambda: (cells(costmap.grids["heading_1"][-1])[40:80, 40:80] == PASSABLE).all(), "heading"
    )
    assert call(costmap.ask, GetMap.Request()).map.data == grid.data


def test_a_change_of_the_map_changes_the_grid_around_it(mapping, client, ros):
    costmap = ros.spin(Costmap(ros, ("worst", "best")))
    wait_until(lambda: costmap.grids["worst"] and costmap.grids["best"], "the grids", 60.0)
    wait_until(
        lambda: (cells(costmap.grids["worst"][-1])[40:80, 40:80] == PASSABLE).all(), "map", 60.0
    )
    before = cells(costmap.grids["worst"][-1])
    client.send_terrain(make_terrain(slope_and_rock, half=3.0))
    wait_until(lambda: cells(costmap.grids["worst"][-1])[94, 100] == IMPASSABLE, "the rock", 60.0)
    after = cells(costmap.grids["worst"][-1])
    np.testing.assert_array_equal(after[:60, :60], before[:60, :60])
    assert (cells(costmap.grids["best"][-1])[94:106:4, 94] != PASSABLE).any()


def test_without_the_parameter_there_is_no_map(mapped, ros):
    costmap = ros.spin(Costmap(ros, ("worst",)))
    assert len(call(costmap.ask, GetMap.Request()).map.data) == 0
    assert costmap.grids["worst"] == []
