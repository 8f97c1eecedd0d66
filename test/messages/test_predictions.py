# SPDX-License-Identifier: Apache-2.0
"""Predictions become arrays, a trajectory, markers; verdicts become a status and strict JSON."""

import array
import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Float64MultiArray, Header
from visualization_msgs.msg import Marker

from msg_adapters.errors import MessageError
from msg_adapters.paths import settled_path
from msg_adapters.results.diagnostics import VERDICT, make_status, texts_of, to_json
from msg_adapters.results.markers import GREEN, LIME, RED, path_markers
from msg_adapters.results.predictions import JOINTS, array_values, joint_trajectory, waypoint_array
from rover_physics import judge_path
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.traversability import classification
from support.grounds import make_terrain, plane, waves
from support.paths import poses_at
from support.rovers import FIXED, LSR1

STAMP = Time(sec=12, nanosec=34)
HEADER = Header(frame_id="map", stamp=STAMP)


@pytest.fixture(scope="module")
def prediction():
    """Return 60 waypoints over waves, the last ten of them off the map."""
    x = -1.0 + 0.05 * np.arange(60)
    x[50:] += 6.0
    predicted = judge_path(LSR1, make_terrain(waves), poses_at(x, 0.0, 0.1))[0]
    assert predicted.settled[:50].all() and not predicted.settled[50:].any()
    return predicted


def test_an_array_has_labelled_dimensions_and_values_of_their_number():
    values = np.arange(12.0).reshape(2, 6)
    message = waypoint_array(values)
    dimensions = [(one.label, one.size, one.stride) for one in message.layout.dim]
    assert dimensions == [("waypoint", 2, 12), ("wheel", 6, 6)]
    assert isinstance(message.data, array.array) and message.data.typecode == "d"
    np.testing.assert_array_equal(array_values(message), values)
    message.data = message.data[:-1]
    with pytest.raises(MessageError, match=r"dimensions \[2, 6\] and 11 values"):
        array_values(message)
    with pytest.raises(MessageError, match=r"dimensions \[\] and 0 values"):
        array_values(Float64MultiArray())


def test_the_trajectory_names_its_joints_and_ends_where_the_rover_cannot_settle(prediction):
    message = joint_trajectory(prediction, LSR1, HEADER)
    assert message.header.frame_id == "map" and message.header.stamp == STAMP
    names = SUSPENSION_JOINTS + WHEEL_JOINTS + steering_joints(LSR1)
    assert tuple(message.joint_names) == names
    assert len(message.points) == 50
    for i in (0, 20, 49):
        point = message.points[i]
        np.testing.assert_array_equal(
            point.positions[:4], [*prediction.rocker_angle[i], *prediction.bogie_angle[i]]
        )
        np.testing.assert_array_equal(point.effort[:4], 0.0)
        np.testing.assert_array_equal(point.effort[4:10], prediction.torque[i])
        np.testing.assert_array_equal(point.velocities[4:10], prediction.wheel_speed[i])
        assert len(point.positions) == len(point.velocities) == len(point.effort) == 14
        seconds = point.time_from_start.sec + point.time_from_start.nanosec * 1e-9
        assert seconds == pytest.approx(prediction.time[i], abs=1e-8)
    assert tuple(joint_trajectory(prediction, FIXED, HEADER).joint_names) == JOINTS


def test_in_a_turn_on_the_spot_wheels_of_one_side_roll_forwards_and_of_the_other_back():
    turned = np.linspace(0.0, 1.0, 30)
    prediction = judge_path(LSR1, plane(0.0, 0.0), poses_at(0.0, 0.0, turned))[0]
    last = joint_trajectory(prediction, LSR1, HEADER).points[-1]
    reach = np.hypot([0.4, 0.0, 0.4], 0.31) / LSR1.wheel.radius
    assert last.positions[4:10] == pytest.approx([*reach, *-reach], rel=0.01)
    assert (np.sign(last.velocities[4:10]) == np.sign(last.positions[4:10])).all()


def test_a_settled_path_has_height_and_full_orientation(prediction):
    path = settled_path(prediction, [0, 10, 49], HEADER)
    for pose, i in zip(path.poses, (0, 10, 49), strict=True):
        place = pose.pose.position
        np.testing.assert_array_equal((place.x, place.y, place.z), prediction.position[i])
        turn = pose.pose.orientation
        right = xyzw_from_rpy(prediction.roll[i], prediction.pitch[i], prediction.poses[i, 2])
        np.testing.assert_array_equal((turn.x, turn.y, turn.z, turn.w), right)
        assert abs(turn.x) > 1e-3 and abs(turn.y) > 1e-3
        assert pose.header == path.header and path.header.stamp == STAMP


def test_markers_colour_the_path_and_show_where_it_fails(prediction):
    reasons = [""] * 50 + ["off the map"] * 10
    markers = path_markers(prediction, reasons, np.arange(0, 60, 7), HEADER).markers
    by_namespace = {marker.ns: marker for marker in markers}
    assert markers[0].action == Marker.DELETEALL
    line = by_namespace["path"]
    assert len(line.points) == len(line.colors) == 10
    assert line.colors == [GREEN] * 8 + [RED] * 2
    assert line.points[-1].z == prediction.position[49, 2]
    assert by_namespace["reason"].text == "off the map"
    assert by_namespace["failing_pose"].pose.position.x == prediction.poses[50, 0]
    contacts = by_namespace["contact_points"].points
    assert len(contacts) == 8 * 6
    np.testing.assert_array_equal(
        [[p.x, p.y, p.z] for p in contacts[:6]], prediction.contact_points[0]
    )
    assert all(marker.header.stamp == STAMP for marker in markers)
    classes = [classification.WITH_SPEED_SERVOS] * 60
    drawn = path_markers(prediction, [""] * 60, np.arange(0, 60, 7), HEADER, classes)
    assert LIME in next(m for m in drawn.markers if m.ns == "path").colors


def test_every_entry_of_a_verdict_becomes_a_key_and_a_value():
    told = {
        "traversable": (False, "false"),
        "code": ("tilt", "tilt"),
        "mismatch": ({"rocker_left": 0.25}, '{"rocker_left": 0.25}'),
        "goal": ([1.0, None], "[1.0, null]"),
    }
    entries = {key: value for key, (value, _) in told.items()}
    status = make_status(VERDICT, "error", "tilt 0.6 rad", texts_of(entries), "lsr1")
    assert status.level == DiagnosticStatus.ERROR and status.message == "tilt 0.6 rad"
    assert status.hardware_id == "lsr1" and status.name
    values = {entry.key: entry.value for entry in status.values}
    assert values == {key: text for key, (_, text) in told.items()}


def test_json_has_no_nan_and_no_infinity():
    with pytest.raises(ValueError):
        to_json({"number": math.nan})
