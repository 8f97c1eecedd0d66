"""The traverse server finds ways around obstacles over DDS, and says why there is none."""

import threading

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray

from msg_adapters.paths import path_to_poses
from msg_adapters.results.closed_areas import NOT_REACHED, REACHED
from rover_physics.terrain.grid import Terrain
from rover_planner.ros.qos import topic_qos
from support.grounds import make_terrain, waves
from support.planner_client import SERVER, ask
from support.waiting import wait_until

START, GOAL = (-2.5, 0.0, 0.0), (2.5, 0.0, 0.0)


def wall_with_gap(x, y):
    """Return waves with a wall of 1 m along y at x = 0, open beyond y = 2."""
    return waves(x, y) + np.where((np.abs(x) < 0.1) & (y < 2.0), 1.0, 0.0)


def pen(x, y):
    """Return waves with a wall of 1 m around a square of 4 m."""
    edge = np.maximum(np.abs(x), np.abs(y))
    return waves(x, y) + np.where(np.abs(edge - 2.0) < 0.1, 1.0, 0.0)


@pytest.fixture
def patient(server, client):
    """Return the client of a server with time enough for a busy machine."""
    assert client.set_parameter("search_budget", 60.0) == (True, "")
    assert client.set_parameter("time_budget", 120.0) == (True, "")
    return client


def test_where_all_candidates_are_refused_a_way_around_is_the_plan(patient, server):
    patient.send_terrain(make_terrain(wall_with_gap))
    plan, verdict, results = ask(patient, start=START, goal=GOAL)
    assert verdict["traversable"] == "true" and verdict["code"] == ""
    poses = path_to_poses(plan, "map")
    assert poses[:, 1].max() > 2.0
    np.testing.assert_allclose(poses[[0, -1]], [START, GOAL], atol=1e-9)
    assert int(verdict["chosen_candidate"]) == int(verdict["candidates"]) > 1
    assert len(results["closed_area"].data) == 0
    answer = patient.check_poses(server, poses)
    assert answer.success, answer.message


def test_the_plan_keeps_turns_on_the_spot_so_that_it_passes_as_a_path(patient, server):
    patient.send_terrain(make_terrain(waves))
    assert patient.set_parameter("planner", "lattice") == (True, "")
    plan, verdict, _ = ask(patient, start=(0.0, 0.0, 0.0), goal=(-0.1, 0.3, 2.8))
    assert verdict["traversable"] == "true"
    poses = path_to_poses(plan, "map")
    turns = np.abs(np.angle(np.exp(1j * np.diff(poses[:, 2]))))
    assert turns.max() < 0.5
    assert patient.check_poses(server, poses).success


def test_without_a_way_the_code_says_so_and_the_closed_area_is_a_grid(patient):
    patient.send_terrain(make_terrain(pen))
    plan, verdict, results = ask(patient, start=(0.0, 0.0, 0.0), goal=(3.0, 0.0, 0.0))
    assert plan.poses == [] and verdict["code"] == "no_way"
    assert "closed in by" in verdict["reason"] and "the best candidate: " in verdict["reason"]
    grid = results["closed_area"]
    assert grid.header.stamp == results["plan"].header.stamp and grid.header.frame_id == "map"
    values = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    rows, columns = np.nonzero(values == REACHED)
    assert len(rows) > 0 and set(np.unique(values)) == {REACHED, NOT_REACHED}
    resolution, origin = grid.info.resolution, grid.info.origin.position
    for values, first in ((columns, origin.x), (rows, origin.y)):
        assert np.abs(first + resolution * (values + 0.5)).max() < 2.1


def test_a_search_that_has_no_time_left_has_another_code(patient):
    patient.send_terrain(make_terrain(pen))
    assert patient.set_parameter("search_budget", 0.05) == (True, "")
    _, verdict, _ = ask(patient, start=(0.0, 0.0, 0.0), goal=(3.0, 0.0, 0.0))
    assert verdict["code"] == "out_of_time" and "0.05 s" in verdict["reason"]


def test_the_fan_alone_is_there_for_who_wants_it(patient):
    patient.send_terrain(make_terrain(wall_with_gap))
    assert patient.set_parameter("planner", "fan") == (True, "")
    _, verdict, _ = ask(patient, start=START, goal=GOAL)
    assert verdict["traversable"] == "false" and verdict["code"] not in ("no_way", "out_of_time")


def test_after_a_new_map_the_way_is_searched_on_it(patient):
    ground = make_terrain(wall_with_gap)
    patient.send_terrain(ground)
    first, _, _ = ask(patient, start=START, goal=GOAL)
    elevation = np.array(ground.elevation)
    elevation[np.ix_(np.abs(np.arange(161) * 0.05 - 4.0) < 0.6, np.arange(161) == 80)] = 0.0
    patient.send_terrain(Terrain(elevation, ground.resolution, ground.origin))
    again, verdict, _ = ask(patient, start=START, goal=GOAL)
    assert verdict["traversable"] == ("true" if again.poses else "false")
    assert len(first.poses) > 0 and again.poses != first.poses


def test_a_search_tells_of_its_progress_and_goes_on_with_a_newer_map(patient):
    reports, plans = [], []
    patient.create_subscription(
        DiagnosticArray, f"{SERVER}/search_progress", reports.append, topic_qos()
    )
    assert patient.set_parameter("lattice_cell", 0.06) == (True, "")  # so that it takes long
    patient.send_terrain(make_terrain(pen))
    goal = (3.0, 0.0, 0.0)
    asking = threading.Thread(target=lambda: plans.append(patient.can_traverse((0, 0, 0), goal)))
    asking.start()
    wait_until(lambda: reports, "the first report")
    values = {entry.key: entry.value for entry in reports[0].status[0].values}
    assert values["found"] == "False" and float(values["cost"]) == np.inf
    assert int(values["edges_judged"]) >= 0 and float(values["seconds"]) >= 0.0
    patient.send_terrain(make_terrain(waves))
    asking.join(60.0)
    assert plans and len(plans[0].poses) > 0
