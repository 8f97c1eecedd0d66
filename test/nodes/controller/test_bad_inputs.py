"""Inputs that cannot be used stop the rover, are named once, and pass by themselves."""

import copy
import math

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState, PointCloud2

from support.driven_rover import JOINTS
from msg_adapters.elevation import terrain_to_point_cloud
from rover_physics.errors import ModelError
from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.ros.qos import map_qos, sensor_qos
from support.ros_fixtures import run_in_executor
from support.rough_grounds import plane
from support.waiting import wait_until

CYCLES_IN_A_TENTH = 5


def nan_rate(rover):
    rover.joints.velocity[len(SUSPENSION_JOINTS) + 2] = math.nan


def fast_wheel(rover):
    rover.joints.velocity[len(SUSPENSION_JOINTS)] = 1000.0


def nan_angle(rover):
    rover.joints.position[0] = math.nan


def nan_attitude(rover):
    rover.imu.orientation.w = math.nan


def large_attitude(rover):
    rover.imu.orientation.w = 1e155


def nan_turning(rover):
    rover.imu.angular_velocity.y = math.nan


def fast_turning(rover):
    rover.imu.angular_velocity.y = 1000.0


def other_frame(rover):
    rover.imu.header.frame_id = "imu_link"


def nan_speed(rover):
    rover.speed = math.nan


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (nan_rate, "velocity nan of front_right_wheel"),
        (fast_wheel, "velocity 1000 of rear_right_wheel; it must be within 20 rad/s"),
        (nan_angle, "position nan of rocker_right"),
        (nan_attitude, "imu has orientation"),
        (large_attitude, "imu has orientation [0.0, 0.0, 0.0, 1e+155]"),
        (nan_turning, "imu has angular velocity"),
        (fast_turning, "imu has angular velocity [0.0, 1000.0, 0.0]"),
        (other_frame, "imu is in frame 'imu_link'; it must be in 'base_link', or the parameters"),
        (nan_speed, "cmd_vel has linear.x nan"),
    ],
)
def test_what_cannot_be_used_stops_the_rover_is_said_once_and_passes_by_itself(
    rover, controller, spoil, text
):
    kept = copy.deepcopy(rover.joints), copy.deepcopy(rover.imu), rover.speed
    spoil(rover)
    spoilt = rover.wait_for_send()
    wait_until(lambda: rover.state == "fault", "the fault")
    heard = len(rover.commands)
    wait_until(lambda: len(rover.commands) > heard + 20, "commands")
    assert sum(push > 0.0 for _, push in rover.commands_after(spoilt)) <= CYCLES_IN_A_TENTH
    wait_until(lambda: text in controller.statistics.last.fault, "the reason")
    wait_until(lambda: rover.count_lines(text), "the reason in the log")
    wait_until(lambda: text in rover.status.message, "the reason in the diagnostics")
    assert rover.status.level == rover.status.ERROR
    told = len(rover.log)
    rover.joints, rover.imu, rover.speed = kept
    wait_until(lambda: rover.state == "driving" and rover.push > 0.0, "driving again")
    good = "all inputs are right"
    wait_until(lambda: any(good in line for line in rover.log[told:]), "the good news")
    assert rover.count_lines(text) == 1


def leave_out(rover, joint):
    kept = [i for i, name in enumerate(JOINTS) if name != joint]
    whole = rover.joints
    rover.joints = JointState(
        name=[JOINTS[i] for i in kept],
        position=[whole.position[i] for i in kept],
        velocity=[whole.velocity[i] for i in kept],
    )


def test_a_wheel_that_is_never_measured_is_named(ros, rover, start_controller):
    leave_out(rover, "rear_left_wheel")
    start_controller()
    text = "waiting for joint_states (no velocity of rear_left_wheel)"
    wait_until(lambda: text in rover.status.message, "the wheel's name")
    wait_until(lambda: rover.commands and rover.brakes, "command and brake")
    assert rover.torque == 0.0 and rover.brakes[-1]


def test_a_steering_joint_that_is_never_measured_is_named_and_the_rover_rests(
    ros, rover, start_controller
):
    leave_out(rover, "front_left_steering")
    start_controller()
    text = "waiting for joint_states (no position of front_left_steering)"
    wait_until(lambda: text in rover.status.message, "the joint's name")
    wait_until(lambda: rover.states, "the state")
    assert set(rover.states) == {"fault"}


@pytest.mark.parametrize(("side", "angle"), [("left", 0.2), ("right", -0.2)])
def test_steering_is_read_with_the_sign_of_the_rover(rover, start_controller, side, angle):
    rover.joints.position[JOINTS.index("front_left_steering")] = 0.2
    controller = start_controller(steering_sign=side)
    wait_until(lambda: controller.service.steering[5] == angle, "the angle")


def test_joints_that_do_not_reach_the_steering_limit_end_the_start(ros, start_controller):
    with pytest.raises(ModelError, match=r"reach 0\.5 rad.*must be at most 0\.5"):
        start_controller(steering_limit=0.5)


def test_messages_of_an_arm_between_those_of_the_wheels_change_nothing(ros, rover, controller):
    arm = JointState(name=["arm_yaw"], position=[0.1], velocity=[0.0])
    bad = JointState(name=["arm_yaw"], position=[math.nan, 0.0])
    sender = rover.create_publisher(JointState, "joint_states", sensor_qos())
    heard = len(rover.commands)

    def send():
        sender.publish(arm)
        sender.publish(bad)
        return rover.pushes_on(heard, 50)

    wait_until(send, "a second of commands that push")
    assert rover.faults == []


@pytest.mark.parametrize("field", ["orientation", "position", "covariance", "frame"])
def test_corrupt_odometry_is_not_used_and_the_rover_drives_on(ros, rover, controller, field):
    sender = rover.create_publisher(Odometry, "odometry", sensor_qos())
    cloud = rover.create_publisher(PointCloud2, "elevation_cloud", map_qos())
    cloud.publish(terrain_to_point_cloud(plane(0.0, 0.0, half=3.0), "map", Time()))
    odometry = Odometry(child_frame_id="base_link")
    odometry.header.frame_id = "map"
    if field == "orientation":
        odometry.pose.pose.orientation.x = 1e155
    elif field == "position":
        odometry.pose.pose.position.y = 1e200
    elif field == "covariance":
        odometry.pose.covariance[7] = math.nan
    else:
        odometry.child_frame_id = "mast"

    def send():
        sender.publish(odometry)
        return rover.count_lines("odometry not used: odometry ")

    wait_until(send, "the refusal in the log")
    heard = len(rover.commands)
    wait_until(lambda: len(rover.commands) > heard + 20, "commands")
    wait_until(lambda: rover.push > 0.0 and rover.state == "driving", "driving")
    assert ros.is_alive(controller) and rover.faults == []


def test_an_unforeseen_error_in_a_callback_is_a_fault_and_not_the_end(
    ros, rover, controller, monkeypatch
):
    def fail(*arguments):
        raise ZeroDivisionError("unforeseen")

    with monkeypatch.context() as patch:
        patch.setattr(controller.service, "take_attitude", fail)
        wait_until(lambda: rover.state == "fault", "the fault")
        wait_until(lambda: rover.count_lines("Traceback"), "the trace")
        text = "internal error: ZeroDivisionError: unforeseen"
        wait_until(lambda: text in rover.status.message, "the reason in the diagnostics")
        values = {item.key: item.value for item in rover.status.values}
        assert int(values["internal_errors"]) > 0
    wait_until(lambda: rover.state == "driving", "driving")
    assert rover.count_lines("Traceback") == 1 and ros.is_alive(controller)


def test_a_command_of_ten_per_second_is_no_drop_out(rover, start_controller):
    rover.cmd_vel_divider = 5
    start_controller(cmd_vel_timeout=0.5)
    wait_until(lambda: rover.state == "driving" and rover.push > 0.0, "driving")
    heard = len(rover.commands)
    wait_until(lambda: rover.pushes_on(heard, 100), "two seconds of commands that push")


def test_a_map_is_used_though_it_comes_twice_and_a_bad_one_leaves_it(rover, controller):
    cloud = terrain_to_point_cloud(plane(0.0, 0.0, half=3.0), "map", Time())
    sender = rover.create_publisher(PointCloud2, "elevation_cloud", map_qos())
    odometry = rover.create_publisher(Odometry, "odometry", sensor_qos())
    place = Odometry(child_frame_id="base_link")
    place.header.frame_id = "map"
    place.pose.pose.position.z = 0.3
    sender.publish(cloud)

    def source_is_map():
        odometry.publish(place)
        last = controller.statistics.last
        return last.estimate is not None and last.estimate.source == "map"

    wait_until(source_is_map, "the map")
    cloud.header.frame_id = "elsewhere"
    sender.publish(cloud)
    wait_until(lambda: rover.count_lines("elevation_cloud refused"), "the refusal in the log")
    wait_until(source_is_map, "the last map")


def test_a_change_of_the_cell_height_acts_on_the_map_that_is_there(rover, controller):
    sender = rover.create_publisher(PointCloud2, "elevation_cloud", map_qos())
    points = terrain_to_point_cloud(plane(0.0, 0.0, half=3.0), "map", Time())
    sender.publish(points)
    first = wait_until(lambda: controller.service._terrain, "the map")
    changes = [Parameter("map_resolution", value=0.2), Parameter("cell_height", value="mean")]
    changed = run_in_executor(controller, lambda: controller.set_parameters_atomically(changes))
    assert changed.successful
    wait_until(lambda: controller.service._terrain is not first, "the map in other cells")
    assert controller.service._terrain.resolution == 0.2


def test_a_mounted_imu_is_turned_into_the_body_frame(rover, start_controller):
    rover.imu.header.frame_id = "imu_link"
    rover.imu.orientation.w, rover.imu.orientation.z = 0.0, 1.0
    rover.imu.angular_velocity.x = 0.1
    node = start_controller(imu_frame="imu_link", imu_mounting=[0.0, 0.0, math.pi])
    wait_until(lambda: rover.state == "driving", "driving")
    assert node.service._body_rates == pytest.approx([-0.1, 0.0, 0.0])
    assert isinstance(rover.twist, TwistStamped)
