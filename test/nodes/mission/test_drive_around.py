# SPDX-License-Identifier: Apache-2.0
"""The whole system drives around boulders that it sees only on the way, on both engines."""

import numpy as np
import pytest

from rover_physics import load_rover, save_terrain
from rover_planner.nodes.mission.drive import Drive, DriveSettings
from rover_planner.nodes.rover_simulator import RoverSimulator
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.planning.path_query import PathQueryOptions, answer_path_query
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.waiting import wait_until


@pytest.mark.long  # two to three minutes each
@pytest.mark.slow
@pytest.mark.timed
@pytest.mark.parametrize("engine", ["quasi_static", "mujoco"])
def test_a_rover_drives_around_boulders_that_it_sees_on_the_way(ros, planner, tmp_path, engine):
    terrain = make_mars_terrain(4, 8.0, rock_cover=0.25, crater_density=0.0)
    start, goal = (-0.01, -0.45, 0.45), (2.8, -0.25, 2.02)
    save_terrain(tmp_path / "ground.npz", terrain)
    options = PathQueryOptions().change(policy="optimal")
    fan = answer_path_query(load_rover("lsr1"), terrain, start, goal, options)
    assert not fan.traversable

    server = ros.start(
        TraverseServer,
        policy="optimal",
        map_updates="merge",
        search_frontier=True,
        search_budget=8.0,
        time_budget=60.0,
    )
    controller = ros.start(TractionController, enabled_at_start=True)
    simulator = ros.start(
        RoverSimulator,
        terrain_file=str(tmp_path / "ground.npz"),
        start_x=start[0],
        start_y=start[1],
        start_yaw=start[2],
        engine=engine,
        sensor_range=4.0,
        sensor_occlusion=False,
        map_rate=1.0,
        follow_commands=True,
        speed=0.1,
    )
    planner.wait_for_server()
    wait_until(lambda: server.service.terrain is not None, "the map")
    known = np.isfinite(server.service.terrain.elevation).sum()
    answer = planner.ask(simulator.simulation.plant.pose(), goal)
    assert answer["traversable"], answer["reason"]
    told = []
    settings = DriveSettings(timeout=400.0, patience=5.0)
    Drive(planner, goal, settings, told.append).run(answer["poses"])
    place = simulator.simulation.plant.pose()
    assert np.hypot(*(place - goal)[:2]) < 0.25
    assert np.isfinite(server.service.terrain.elevation).sum() > known
    for node in (simulator, server, controller):
        assert ros.is_alive(node)
