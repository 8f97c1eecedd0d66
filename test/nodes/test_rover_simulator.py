# SPDX-License-Identifier: Apache-2.0
"""The simulator's node among the others: the whole system on one machine, without hardware."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState, PointCloud2

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.sensors import imu_to_attitude
from msg_adapters.stamps import stamp_to_ns
from rover_physics import save_terrain
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.rover.steering_joints import steering_joints
from rover_planner.nodes.mission.drive import Drive, DriveSettings
from rover_planner.nodes.rover_simulator import RoverSimulator
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.ros.qos import LATCHED_QOS, SENSOR_QOS, TOPIC_QOS
from support.grounds import make_terrain, waves
from support.ros_fixtures import PATIENT, hear, run_in_executor
from support.waiting import wait_until

START_X = -1.0


@pytest.fixture(scope="module")
def terrain_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("maps") / "waves.npz"
    save_terrain(path, make_terrain(waves, half=4.0))
    return str(path)


@pytest.fixture
def start_simulator(ros, terrain_file):
    """Return a function that starts a simulator with parameters."""

    def start(**others):
        given = {"terrain_file": terrain_file, "start_x": START_X, "speed": 0.08} | others
        return ros.start(RoverSimulator, **given)

    return start


class Ear(Node):
    """Keeps what it hears, and commands a motion."""

    def __init__(self, ros):
        super().__init__("ear", context=ros.context)
        self.joint_states = hear(self, JointState, "joint_states", TOPIC_QOS)  # reliable
        self.imu = hear(self, Imu, "imu", SENSOR_QOS)
        self.clouds = hear(self, PointCloud2, "elevation_cloud", LATCHED_QOS)
        self.diagnostics = hear(self, DiagnosticArray, "/diagnostics")
        self._commands = self.create_publisher(TwistStamped, "cmd_vel", SENSOR_QOS)

    def command(self, speed, yaw_rate=0.0):
        twist = TwistStamped()
        twist.twist.linear.x, twist.twist.angular.z = speed, yaw_rate
        self._commands.publish(twist)


@pytest.fixture
def ear(ros):
    return ros.spin(Ear(ros))


def test_it_publishes_what_a_rover_would_drives_as_commanded_and_stops_when_commands_stop(
    ear, start_simulator
):
    simulator = start_simulator(steering_sign="right")
    for heard in (ear.joint_states, ear.imu, ear.clouds, ear.diagnostics):
        wait_until(lambda heard=heard: heard, "joint states, attitude, map and diagnostics")
    state, imu = ear.joint_states[-1], ear.imu[-1]
    rover, plant = simulator.simulation.rover, simulator.simulation.plant
    arm, steering = rover.manipulator.joints, steering_joints(rover)
    assert list(state.name) == [*SUSPENSION_JOINTS, *WHEEL_JOINTS, *steering, *arm]
    assert len(state.position) == len(state.velocity) == len(state.effort) == len(state.name)
    attitude = imu_to_attitude(imu)
    assert imu.linear_acceleration.z == pytest.approx(9.81, abs=0.3)
    assert np.isfinite([attitude.roll, attitude.pitch]).all()
    seen = terrain_from_point_cloud(ear.clouds[-1])
    assert np.isfinite(seen.elevation_at(*plant.state().position[:2]))
    status = ear.diagnostics[-1].status[0]
    assert (status.level, status.values[0].key) == (status.OK, "position")
    assert status.values[0].value.startswith(f"[{START_X}, 0.0, ")

    def steers():
        ear.command(0.05, 0.05)
        state = ear.joint_states[-1]
        found = dict(zip(state.name, state.position, strict=True))
        turned = plant.pose()[2] > 0.01 and plant.pose()[0] > START_X + 0.01
        return turned and found["front_left_steering"] < -0.2 and found

    angles = wait_until(steers, "the rover to turn left, with the sign of its joints")
    assert angles["rear_left_steering"] == pytest.approx(-angles["front_left_steering"], abs=0.01)
    wait_until(lambda: plant.state().velocity[0] == 0.0, "the rover to stop")


def test_with_simulated_time_it_is_the_source_of_the_clock_and_late_steps_do_not_show(
    ros, ear, start_simulator
):
    simulator = start_simulator(use_sim_time=True, rate=100.0)
    wait_until(lambda: len(ear.joint_states) > 20, "joint states")
    run_in_executor(simulator, lambda: time.sleep(0.2))
    have = len(ear.joint_states)
    wait_until(lambda: len(ear.joint_states) > have + 20, "more of them")
    stamps = [stamp_to_ns(state.header.stamp) for state in ear.joint_states]
    assert set(np.diff(stamps)) == {10_000_000}
    wait_until(lambda: simulator.get_clock().now().nanoseconds >= stamps[-1], "its own clock")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["quasi_static", "mujoco"])
def test_simulator_server_controller_and_planner_drive_together_to_a_goal(
    ros, start_simulator, start_server, planner, engine
):
    simulator = start_simulator(follow_commands=True, engine=engine, sensor_range=2.0)
    server = start_server(planner="fan", map_updates="merge")
    controller = ros.start(TractionController, enabled_at_start=True, **PATIENT)
    planner.wait_for_server()
    first = wait_until(lambda: server.service.terrain, "the map")
    plant, goal = simulator.simulation.plant, [START_X + 0.25, 0.01, 0.0]
    answer = planner.ask(plant.pose(), goal)
    assert answer.traversable, answer.reason
    settings = DriveSettings(position_tolerance=0.1, timeout=200.0)
    Drive(planner, goal, settings, lambda told: None).run(answer.poses)
    assert np.hypot(*(plant.pose() - goal)[:2]) < 0.1
    assert controller.statistics.updates > 20 and controller.statistics.fallbacks == 0
    last = server.service.terrain
    assert np.isfinite(last.elevation).sum() > np.isfinite(first.elevation).sum()


def test_it_gives_way_to_speeds_from_elsewhere_and_drives_them_by_torques(
    ros, ear, start_simulator
):
    simulation = start_simulator(follow_commands=True).simulation
    controller = ros.start(TractionController, enabled_at_start=True, **PATIENT)
    wait_until(lambda: controller.statistics.updates > 5, "the controller to run")
    place = simulation.plant.pose()

    def has_moved():
        ear.command(0.06)
        return simulation.plant.pose()[0] > place[0] + 0.02 and simulation.steering[0] == 0.06

    wait_until(has_moved, "the rover to move at the speed from elsewhere", 60.0)
    wait_until(lambda: simulation.steering[0] == 0.0, "the speeds to be forgotten")
