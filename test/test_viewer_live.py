"""The page follows a live graph: what a rover publishes is what a visitor sees."""

import numpy as np
import pytest
from grounds import make_terrain, waves
from rclpy.parameter import Parameter
from ros_fixtures import RosRun, wait_until

from rover_physics.rover import load_rover
from rover_physics.terrain import save_terrain
from rover_planner.mission_planner import MissionPlanner
from rover_planner.rover_simulator import RoverSimulator
from rover_planner.traverse_server import TraverseServer
from rover_planner.viewer.live import LiveListener
from rover_planner.viewer.live_frame import LiveFigure

LSR1 = load_rover("lsr1")


@pytest.fixture
def ros():
    run = RosRun()
    yield run
    run.close()


def test_it_shows_the_rover_where_it_is_with_what_was_predicted_there(ros, tmp_path):
    save_terrain(tmp_path / "waves.npz", make_terrain(waves))
    values = {"terrain_file": str(tmp_path / "waves.npz"), "start_x": -1.0, "speed": 0.08}
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    simulator = ros.spin(RoverSimulator(context=ros.context, parameter_overrides=parameters))
    server = ros.spin(TraverseServer(context=ros.context))
    planner = ros.spin(MissionPlanner(context=ros.context))
    listener = ros.spin(LiveListener(context=ros.context))
    planner.wait_for_server()
    wait_until(lambda: server.service.terrain is not None, "the map")
    answer = planner.ask([-1.0, 0.0, 0.0], [0.5, 0.0, 0.0])
    assert answer["traversable"], answer["reason"]
    wait_until(lambda: listener.latest()[2] is not None, "the plan")
    wait_until(lambda: listener.latest()[0].wheel_loads.any(), "the loads")
    state, terrain, plan, verdict = listener.latest()
    assert terrain is not None and len(plan) > 5 and verdict == "traversable"
    frame = LiveFigure(LSR1).frame(state)
    plant = simulator.simulation.plant
    assert frame.position == pytest.approx(plant.state().position, abs=1e-6)
    assert frame.wheel_loads.sum() == pytest.approx(LSR1.weight, rel=0.05)
    lowest = frame.contact_points[:, 2] - np.array(
        [terrain.elevation_at(x, y) for x, y in frame.contact_points[:, :2]]
    )
    assert np.abs(lowest).max() < 0.02
