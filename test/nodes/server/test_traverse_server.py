"""The traverse server answers over DDS, says why not, and outlives every bad message."""

import array
import json
import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.srv import GetPlan
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import path_to_poses, stamped_pose
from msg_adapters.results.predictions import JOINTS, MEASURES, array_values
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.terrain.grid import save_terrain
from rover_planner.nodes.result_topics import WHEEL_TOPICS
from rover_planner.ros.qos import map_qos
from support.grounds import gap, make_terrain, wall_at, waves
from support.planner_client import GOAL, SERVER, START, PlannerClient, ask, verdict_of
from support.ros_fixtures import call
from support.waiting import wait_until


def test_a_passable_goal_gets_a_plan_of_settled_poses(mapped, client):
    plan, verdict, _ = ask(client)
    assert verdict["traversable"] == "true" and verdict["reason"] == ""
    poses = path_to_poses(plan, "map")
    np.testing.assert_allclose(poses[0], START, atol=1e-9)
    np.testing.assert_allclose(poses[-1], GOAL, atol=1e-9)
    spacing = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert spacing.max() <= 0.12 and spacing[:-1].min() >= 0.08
    heights = [pose.pose.position.z for pose in plan.poses]
    ground = mapped.service.terrain.elevation_at(poses[:, 0], poses[:, 1])
    assert np.all(np.abs(heights - ground - 0.3) < 0.1)


def test_results_come_in_the_order_of_the_questions(mapped, client):
    ends = [(2.0, 0.3, 0.0), (1.0, 0.3, 0.0), (9.0, 0.0, 0.0)]
    for end in ends:
        client.can_traverse(START, end)
    told = client.heard["verdict"]
    wait_until(lambda: len(told) == len(ends), "the verdicts")
    goals = [json.loads(verdict_of({"verdict": one})["goal"]) for one in told]
    assert goals == [pytest.approx(end) for end in ends]


def test_all_results_of_a_path_share_stamp_frame_and_waypoints(mapped, client):
    plan, verdict, results = ask(client)
    headers = [results[topic].header for topic in ("plan", "predicted_joints", "verdict")]
    headers += [marker.header for marker in results["markers"].markers]
    headers += [pose.header for pose in plan.poses]
    assert all(header == plan.header for header in headers)
    assert plan.header.frame_id == "map" and plan.header.stamp.sec > 0
    waypoints = int(verdict["waypoints"])
    for topic in WHEEL_TOPICS:
        dims = results[topic].layout.dim
        assert [dim.label for dim in dims] == ["waypoint", "wheel"]
        assert array_values(results[topic]).shape == (waypoints, 6)
    dims = results["tip_over_margin"].layout.dim
    assert [dim.label for dim in dims] == ["waypoint", "measure"]
    assert array_values(results["tip_over_margin"]).shape == (waypoints, len(MEASURES))
    joints = results["predicted_joints"]
    assert tuple(joints.joint_names) == JOINTS + steering_joints(load_rover("lsr1"))
    assert len(joints.points) == waypoints
    last = joints.points[-1].time_from_start
    assert last.sec + last.nanosec * 1e-9 == pytest.approx(float(verdict["time"]), abs=1e-6)


def test_who_comes_after_the_answer_hears_all_results_of_the_last_one(server, ros):
    server.service.take_terrain(make_terrain(waves))
    asker = ros.spin(Node("asker", context=ros.context))
    client = asker.create_client(GetPlan, f"{SERVER}/can_traverse")
    for end in ((1.0, 0.3, 0.0), GOAL):
        request = GetPlan.Request(start=stamped_pose(START, "map"), goal=stamped_pose(end, "map"))
        plan = call(client, request).plan
    late = ros.spin(PlannerClient(ros)).heard

    def heard_all() -> bool:
        if not all(late.values()) or late["plan"][-1] != plan:
            return False
        last = {topic: messages[-1] for topic, messages in late.items()}
        headers = [last[topic].header for topic in ("predicted_joints", "verdict")]
        headers += [marker.header for marker in last["markers"].markers]
        arrays = [array_values(last[topic]) for topic in (*WHEEL_TOPICS, "tip_over_margin")]
        waypoints = int(verdict_of(last)["waypoints"])
        return all(header == plan.header for header in headers) and all(
            len(values) == waypoints for values in arrays
        )

    wait_until(heard_all, "all results of the last answer")


def test_the_results_are_those_of_the_model(mapped, client):
    _, verdict, results = ask(client)
    service = mapped.service
    expected = service.answer(np.array(START), np.array(GOAL)).candidate
    for topic, field in WHEEL_TOPICS.items():
        np.testing.assert_array_equal(
            array_values(results[topic]), getattr(expected.prediction, field)
        )
    assert float(verdict["energy"]) == pytest.approx(expected.prediction.energy[-1])
    weight = service.settings.rover.weight
    loads = array_values(results["wheel_loads"]).sum(axis=1)
    assert np.all(np.abs(loads / weight - 1.0) < 0.05)


def test_a_wall_is_refused_for_a_physical_reason(server, client):
    client.send_terrain(make_terrain(wall_at(0.5)))
    plan, verdict, results = ask(client)
    assert plan.poses == [] and results["plan"].poses == []
    assert verdict["traversable"] == "false" and verdict["reason"]
    assert verdict["code"] not in ("", "off_map", "unknown_ground", "bad_request")
    assert -0.5 < json.loads(verdict["failure_pose"])[0] < 0.6
    namespaces = [marker.ns for marker in results["markers"].markers]
    assert "failing_pose" in namespaces and "reason" in namespaces


def test_leaving_the_map_and_entering_unknown_ground_are_told_apart(server, client):
    client.send_terrain(make_terrain(gap))
    assert client.set_parameter("planner", "fan") == (True, "")
    _, verdict, _ = ask(client)
    assert verdict["code"] == "unknown_ground"
    _, verdict, _ = ask(client, goal=(-5.0, 0.0, math.pi), start=(-2.0, 0.0, math.pi))
    assert verdict["code"] == "off_map"


def test_small_gaps_are_interpolated_on_demand(server, client):
    client.send_terrain(
        make_terrain(lambda x, y: np.where(np.hypot(x, y) < 0.12, np.nan, waves(x, y)))
    )
    goal = (2.0, 0.0, 0.0)
    assert client.set_parameter("candidate_count", 1) == (True, "")
    assert client.set_parameter("planner", "fan") == (True, "")
    _, verdict, _ = ask(client, start=(-2.0, 0.31, 0.0), goal=(2.0, 0.31, 0.0))
    assert verdict["code"] == "unknown_ground"
    assert client.set_parameter("max_gap", 0.3) == (True, "")
    assert client.set_parameter("unknown_cells", "interpolate") == (True, "")
    _, verdict, _ = ask(client, goal=goal)
    assert verdict["traversable"] == "true"


def test_a_padded_big_endian_cloud_in_doubles_gives_the_same_answer(mapped, client):
    expected, _, _ = ask(client)
    terrain = make_terrain(waves)
    rows, columns = terrain.elevation.shape
    point = np.dtype(
        {
            "names": ["z", "x", "y"],
            "formats": [">f8", ">f4", ">f8"],
            "offsets": [2, 13, 20],
            "itemsize": 31,
        }
    )
    points = np.zeros((rows, columns), point)
    points["x"], points["y"] = np.meshgrid(
        -4.0 + 0.05 * np.arange(columns), -4.0 + 0.05 * np.arange(rows)
    )
    points["z"] = terrain.elevation
    raw = np.pad(points.view(np.uint8).reshape(rows, -1), ((0, 0), (0, 7)))
    cloud = PointCloud2(
        height=rows, width=columns, point_step=31, row_step=31 * columns + 7, is_bigendian=True
    )
    cloud.header.frame_id = "map"
    cloud.fields = [
        PointField(
            name=name,
            offset=point.fields[name][1],
            count=1,
            datatype=PointField.FLOAT32 if name == "x" else PointField.FLOAT64,
        )
        for name in ("z", "x", "y")
    ]
    cloud.data = array.array("B", raw.tobytes())
    before = mapped.service.known_map
    client.send_cloud(cloud)
    wait_until(lambda: mapped.service.known_map is not before, "the map")
    assert mapped.service.known_map.fingerprint == before.fingerprint
    plan, _, _ = ask(client)
    assert [pose.pose for pose in plan.poses] == [pose.pose for pose in expected.poses]


def test_a_map_published_before_the_server_came_is_heard(ros, client, start_server):
    publisher = client.create_publisher(PointCloud2, "elevation_cloud", map_qos())
    publisher.publish(terrain_to_point_cloud(make_terrain(waves), "map"))
    server = start_server()
    wait_until(lambda: server.service.terrain is not None, "the map")
    assert len(client.can_traverse(START, GOAL).poses) > 2


def test_a_map_from_a_volatile_publisher_is_heard_once(server, client):
    publisher = client.create_publisher(
        PointCloud2, "elevation_cloud", map_qos(DurabilityPolicy.VOLATILE)
    )
    wait_until(lambda: publisher.get_subscription_count() > 0, "the subscription")
    publisher.publish(terrain_to_point_cloud(make_terrain(waves), "map"))
    client.wait_for_log("map from elevation_cloud")
    client.send_terrain(make_terrain(wall_at(0.5)))
    client.can_traverse(START, GOAL)
    client.wait_for_log("can_traverse: refused")
    assert sum("map from elevation_cloud" in line for line in client.logs) == 1


def test_a_goal_on_a_rock_is_reached_within_the_tolerance(server, client):
    def rock(x, y):
        return waves(x, y) + np.where(np.hypot(x - 2.0, y) < 0.45, 0.7, 0.0)

    client.send_terrain(make_terrain(rock))
    goal = (1.4, 0.0, 0.0)
    plan, verdict, _ = ask(client, goal=goal)
    assert plan.poses == []
    plan, verdict, _ = ask(client, goal=goal, tolerance=0.6)
    assert plan.poses and verdict["traversable"] == "true"
    end = path_to_poses(plan, "map")[-1]
    assert 0.0 < np.hypot(end[0] - goal[0], end[1] - goal[1]) <= 0.6
    assert end[2] == pytest.approx(goal[2])
    assert json.loads(verdict["goal"]) == pytest.approx(end.tolist())


def test_check_path_answers_in_json_with_all_results(mapped, client):
    poses = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    answer, results = client.next_results(lambda: client.check_poses(mapped, poses))
    verdict = json.loads(answer.message)
    assert answer.success and verdict["traversable"] and verdict["first_failure"] == -1
    assert verdict["length"] == pytest.approx(2.0) and verdict["waypoints"] == 101
    assert len(results["plan"].poses) == 21
    assert results["verdict"].status[0].level == DiagnosticStatus.OK


def test_check_path_says_why_not(mapped, client):
    answer = client.check_poses(mapped, [[3.0, 0.0, 0.0], [6.0, 0.0, 0.0]])
    verdict = json.loads(answer.message)
    assert not answer.success and verdict["code"] == "off_map" and verdict["reason"]
    assert 3.0 <= verdict["failure_pose"][0] < 4.0


@pytest.mark.parametrize("form", ["{}", "file://{}", "file://localhost{}"])
def test_a_terrain_file_is_loaded_by_path_or_url(server, client, tmp_path, form):
    terrain = make_terrain(gap)
    file = tmp_path / "some terrain.npz"
    save_terrain(file, terrain)
    url = form.format(str(file).replace(" ", "%20") if "file:" in form else file)
    response = client.load_map(url)
    assert response.result == response.RESULT_SUCCESS
    assert response.map.header.frame_id == "map"
    unknown = np.array(response.map.data).reshape(terrain.elevation.shape) == -1
    np.testing.assert_array_equal(unknown, np.isnan(terrain.elevation))
    np.testing.assert_array_equal(server.service.terrain.elevation, terrain.elevation)


def test_the_server_starts_with_a_terrain_file(start_server, client, tmp_path):
    save_terrain(tmp_path / "start.npz", make_terrain(waves))
    start_server(terrain_file=str(tmp_path / "start.npz"))
    assert len(client.can_traverse(START, GOAL).poses) > 2


def test_the_measured_suspension_raises_a_warning_where_it_disagrees(mapped, client, lasting):
    poses = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    client.send_joints(["camera", "rocker_left"], [math.nan, 0.5])
    wait_until(lambda: mapped.service.joints, "the joints")
    client.send_odometry((-0.5, 0.0, 0.0))
    standing = mapped.service.situation
    wait_until(lambda: standing().measured_pose is not None, "the odometry")
    answer, results = client.next_results(lambda: client.check_poses(mapped, poses))
    verdict = json.loads(answer.message)
    assert answer.success and not verdict["suspension_agrees"]
    assert verdict["suspension_mismatch"]["rocker_left"] == pytest.approx(0.5, abs=0.05)
    assert results["verdict"].status[0].level == DiagnosticStatus.WARN


def test_a_real_map_is_answered_for_over_dds_as_from_its_file(
    server,
    client,
    real_map,
):
    terrain = real_map("erc_marsyard2021_9cm")
    client.send_terrain(terrain)
    np.testing.assert_array_equal(server.service.terrain.elevation, terrain.elevation)
    plan, verdict, _ = ask(client, start=(-4.0, 0.0, 0.0), goal=(6.0, 1.0, 0.0))
    assert verdict["traversable"] == "true" and len(plan.poses) > 40
    plan, verdict, _ = ask(client, start=(-3.5, -7.0, 0.0), goal=(3.0, -7.0, 0.0))
    assert plan.poses == [] and verdict["code"] not in ("", "off_map", "unknown_ground")
