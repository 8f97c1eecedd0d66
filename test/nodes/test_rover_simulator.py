"""The simulator's node among the others: the whole system on one machine, without hardware."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_srvs.srv import SetBool

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.imu import imu_to_attitude
from rover_physics.errors import SoilError
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.terrain.grid import load_terrain, save_terrain
from rover_planner.nodes.mission.drive import DriveFailedError, DriveSettings, drive_to
from rover_planner.nodes.mission_planner import MissionPlanner
from rover_planner.nodes.rover_simulator import RoverSimulator, main
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.ros.qos import map_qos, sensor_qos, topic_qos
from support.grounds import make_terrain, wall_at, waves
from support.ros_fixtures import PATIENT, RosRun, call
from support.waiting import wait_until

START_X = -1.0


@pytest.fixture
def ros():
    run = RosRun()
    yield run
    run.close()


@pytest.fixture(scope="module")
def terrain_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("maps") / "waves.npz"
    save_terrain(path, make_terrain(waves, half=4.0))
    return str(path)


def make_simulator(ros, terrain_file, **values) -> RoverSimulator:
    """Return a simulator that is not spun yet."""
    values = {"terrain_file": terrain_file, "start_x": START_X, "speed": 0.08} | values
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    return RoverSimulator(context=ros.context, parameter_overrides=parameters)


def start_simulator(ros, terrain_file, **values) -> RoverSimulator:
    return ros.spin(make_simulator(ros, terrain_file, **values))


def start_controller(ros, enabled=True) -> TractionController:
    """Return a controller with the longest timeouts, for the sake of busy machines."""
    values = {"enabled_at_start": enabled} | PATIENT
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    return ros.spin(TractionController(context=ros.context, parameter_overrides=parameters))


def start_server(ros) -> TraverseServer:
    """Return a server that answers however busy the machine is."""
    values = [Parameter("time_budget", value=60.0)]
    return ros.spin(TraverseServer(context=ros.context, parameter_overrides=values))


class Ear(Node):
    """Keeps what it hears."""

    def __init__(self, ros):
        super().__init__("ear", context=ros.context)
        self.heard = {}
        for kind, topic, qos in (
            (JointState, "joint_states", sensor_qos()),
            (Imu, "imu", sensor_qos()),
            (PointCloud2, "elevation_cloud", map_qos()),
            (DiagnosticArray, "/diagnostics", topic_qos()),
        ):
            self.create_subscription(kind, topic, self._keeper(topic), qos)
        self.commands = self.create_publisher(TwistStamped, "cmd_vel", sensor_qos())
        ros.spin(self)

    def _keeper(self, topic):
        return lambda message: self.heard.setdefault(topic, []).append(message)


def test_it_publishes_what_a_rover_would(ros, terrain_file):
    ear = Ear(ros)
    simulator = start_simulator(ros, terrain_file)
    wanted = {"joint_states", "imu", "elevation_cloud"}
    wait_until(lambda: wanted <= ear.heard.keys(), "joint states, attitude and map")
    state = ear.heard["joint_states"][-1]
    arm = simulator.simulation.settings.rover.manipulator.joints
    steering = steering_joints(simulator.simulation.settings.rover)
    assert list(state.name) == [*SUSPENSION_JOINTS, *WHEEL_JOINTS, *steering, *arm]
    assert len(state.position) == len(state.velocity) == len(state.effort) == len(state.name)
    attitude = imu_to_attitude(ear.heard["imu"][-1])
    settled = simulator.simulation.plant.state()
    assert ear.heard["imu"][-1].linear_acceleration.z == pytest.approx(9.81, abs=0.3)
    assert np.isfinite([attitude.roll, attitude.pitch]).all()
    seen = terrain_from_point_cloud(ear.heard["elevation_cloud"][-1])
    assert np.isfinite(seen.elevation_at(*settled.position[:2]))


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_joint_states_have_the_steering_angles_with_the_sign_of_the_rover(
    ros, terrain_file, side, sign
):
    ear = Ear(ros)
    simulator = start_simulator(ros, terrain_file, steering_sign=side)
    twist = TwistStamped()
    twist.twist.linear.x, twist.twist.angular.z = 0.05, 0.05

    def has_turned():
        ear.commands.publish(twist)
        return simulator.simulation.plant.pose()[2] > 0.03

    def steers():
        turned, heard = has_turned(), ear.heard.get("joint_states", ())
        found = dict(zip(heard[-1].name, heard[-1].position, strict=True)) if heard else {}
        return turned and sign * found.get("front_left_steering", 0.0) > 0.2 and found

    angles = wait_until(steers, "the rover to turn left, with the sign of its joints")
    assert angles["rear_left_steering"] == pytest.approx(-angles["front_left_steering"], abs=0.01)


def test_it_drives_as_commanded_and_stops_when_commands_stop(ros, terrain_file):
    ear = Ear(ros)
    simulator = start_simulator(ros, terrain_file)
    twist = TwistStamped()
    twist.twist.linear.x = 0.08
    plant = simulator.simulation.plant

    def has_moved():
        ear.commands.publish(twist)
        return plant.pose()[0] > START_X + 0.05

    wait_until(has_moved, "the rover to move")
    wait_until(lambda: plant.state().velocity[0] == 0.0, "the rover to stop")


def test_bad_parameters_are_refused_by_name(ros, terrain_file):
    from rover_planner.errors import PlanningError

    with pytest.raises(PlanningError, match="cannot start"):
        start_simulator(ros, terrain_file, start_x=50.0)
    with pytest.raises(SoilError, match="no soil 'dry_snad'.*dry_sand"):
        start_simulator(ros, terrain_file, soil="dry_snad")
    with pytest.raises(PlanningError, match="policy is 'fair'"):
        start_simulator(ros, terrain_file, policy="fair")
    for other in ({"soil": "dry_sand"}, {"policy": "optimal"}):
        with pytest.raises(PlanningError, match=f"{next(iter(other))} is .* engine mujoco"):
            start_simulator(ros, terrain_file, engine="mujoco", **other)


def test_soil_and_policy_are_those_of_the_model_that_moves_it(ros, terrain_file):
    given = {"soil": "dry_sand", "policy": "optimal"}
    simulator = make_simulator(ros, terrain_file, **given)  # nothing else drives its plant
    plant = simulator.simulation.plant
    model = sweep_path(
        load_rover("lsr1"),
        load_terrain(terrain_file),
        np.array([[START_X, 0.0, 0.0]]),
        SweepOptions(**given),
    )
    plant.drive(0.08, 0.0, 1e-9)
    assert (model.motion_resistance > 0.0).all()
    assert plant.state().wheel_torques == pytest.approx(model.torque[0], rel=1e-3)
    simulator.destroy_node()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["quasi_static", "mujoco"])
def test_simulator_server_controller_and_planner_drive_together_to_a_goal(
    ros, terrain_file, engine
):
    simulator = start_simulator(ros, terrain_file, follow_commands=True, engine=engine)
    server = start_server(ros)
    controller = start_controller(ros)
    planner = ros.spin(MissionPlanner(context=ros.context))
    planner.wait_for_server()
    wait_until(lambda: server.service.terrain is not None, "the map")
    place = simulator.simulation.plant.pose()
    goal = [place[0] + 0.6, 0.05, 0.0]
    answer = planner.ask(place, goal)
    assert answer["traversable"], answer["reason"]
    told = []
    drive_to(
        planner, goal, answer["poses"], DriveSettings(within=0.15, timeout=200.0), told.append
    )
    assert simulator.simulation.plant.pose()[0] > place[0] + 0.4
    assert controller.statistics.updates > 50
    assert controller.statistics.fallbacks == 0
    for node in (simulator, server, controller, planner):
        assert ros.is_alive(node)


def test_it_gives_way_to_speeds_from_elsewhere_and_drives_them_by_torques(ros, terrain_file):
    ear = Ear(ros)
    simulator = start_simulator(ros, terrain_file, follow_commands=True)
    controller = start_controller(ros)
    wait_until(lambda: controller.statistics.updates > 5, "the controller to run")
    twist = TwistStamped()
    twist.twist.linear.x = 0.06
    place = simulator.simulation.plant.pose()

    def has_moved():
        ear.commands.publish(twist)
        moved = simulator.simulation.plant.pose()[0] > place[0] + 0.05
        return moved and simulator.simulation.steering[0] == 0.06

    wait_until(has_moved, "the rover to move at the speed from elsewhere", 60.0)
    wait_until(lambda: simulator.simulation.steering[0] == 0.0, "the speeds to be forgotten")


@pytest.mark.slow
def test_diagnostics_come_though_nothing_happens_and_say_where_the_rover_is(ros, terrain_file):
    ear = Ear(ros)
    start_simulator(ros, terrain_file)
    wait_until(lambda: len(ear.heard.get("/diagnostics", ())) >= 2, "diagnostics")
    status = ear.heard["/diagnostics"][-1].status[0]
    assert status.level == status.OK
    assert status.values[0].key == "position"
    assert status.values[0].value.startswith(f"[{START_X}, 0.0, ")


@pytest.mark.slow
def test_a_wall_ahead_stops_it_with_the_reason_in_the_diagnostics(ros, tmp_path):
    ear = Ear(ros)
    file = tmp_path / "wall.npz"
    save_terrain(file, make_terrain(wall_at(0.0), half=3.0))
    simulator = start_simulator(ros, str(file), start_x=-0.7)
    twist = TwistStamped()
    twist.twist.linear.x = 0.09

    def says_why():
        ear.commands.publish(twist)
        told = ear.heard.get("/diagnostics", ())
        return [m.status[0] for m in told if m.status[0].level == m.status[0].ERROR]

    [status, *_] = wait_until(says_why, "the reason", 60.0)
    assert any(wheel in status.message for wheel in WHEELS)
    assert simulator.simulation.plant.pose()[0] < 0.0


def test_an_engine_that_is_none_is_refused_by_the_command_line(capfd):
    assert main(["--engine", "horses"]) == 2
    assert "'horses'; it must be one of quasi_static, mujoco" in capfd.readouterr().err


def test_a_rover_that_stands_gets_another_plan_and_at_last_the_drive_is_given_up(
    ros, terrain_file
):
    simulator = start_simulator(ros, terrain_file, follow_commands=True)
    server = start_server(ros)
    controller = start_controller(ros, enabled=False)
    wait_until(lambda: controller.statistics.updates > 5, "the controller to run")
    planner = ros.spin(MissionPlanner(context=ros.context))
    enabling = planner.create_client(SetBool, "traction_controller/enable")
    planner.wait_for_server()
    wait_until(lambda: server.service.terrain is not None, "the map")
    place = simulator.simulation.plant.pose()
    goal = [place[0] + 0.5, 0.05, 0.0]
    answer = planner.ask(place, goal)
    assert answer["traversable"], answer["reason"]
    settings = DriveSettings(within=0.15, timeout=200.0, period=0.1, patience=0.5)
    with pytest.raises(DriveFailedError, match="3 other ways led nowhere from .* stood for 0.5 s"):
        drive_to(planner, goal, answer["poses"], settings, lambda what: None)

    def start_motors_at_the_first_stop(what):
        if "has stood" in what and len(told) == 0:
            call(enabling, SetBool.Request(data=True))
        told.append(what)

    told: list[str] = []
    settings = DriveSettings(within=0.15, timeout=200.0, patience=4.0)
    drive_to(planner, goal, answer["poses"], settings, start_motors_at_the_first_stop)
    assert "another plan" in told[1]
    assert simulator.simulation.plant.pose()[0] > place[0] + 0.3
