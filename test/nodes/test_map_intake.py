# SPDX-License-Identifier: Apache-2.0
"""Maps taken as bytes: each is prepared once, the latest is returned, bad ones are refused."""

import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import is_same_cloud, terrain_from_point_cloud, terrain_to_point_cloud
from msg_adapters.errors import MessageError
from rover_physics.errors import ModelError
from rover_physics.traction.map_contacts import MapContactFinder
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.frames import Frames
from rover_planner.ros.map_intake import MapIntake, read_message
from support.rough_grounds import plane
from support.rovers import LSR1
from support.waiting import wait_until

FRAMES = Frames(TraverseServerParameters(), lambda: 0)


def cloud_of(half, second=0):
    terrain = plane(0.0, 0.0, half=half)
    return serialize_message(terrain_to_point_cloud(terrain, "map", Time(sec=second)))


def test_a_map_is_prepared_once_and_returned_once():
    made, renewed = [], []

    def prepare(cloud, _source):
        made.append(MapContactFinder(LSR1, terrain_from_point_cloud(cloud)))
        return made[-1]

    intake = MapIntake(prepare, made.append, FRAMES, renewed.append)
    intake.offer(cloud_of(1.0))
    prepared = wait_until(intake.take, "a map")
    assert prepared.rover is LSR1 and intake.take() is None
    intake.offer(cloud_of(1.0, second=5))
    wait_until(lambda: renewed, "the same map, later")
    assert renewed[0].header.stamp.sec == 5
    intake.offer(cloud_of(2.0))
    other = wait_until(intake.take, "the next map")
    assert other.terrain.elevation.shape > prepared.terrain.elevation.shape
    assert len(made) == 2
    intake.repeat()
    wait_until(intake.take, "the same map with other settings")
    intake.close()
    assert len(made) == 3 and len(renewed) == 1


def test_a_map_that_cannot_be_used_is_refused_and_the_next_is_taken():
    told = []

    def prepare(cloud, _source):
        if cloud.width < 60:
            raise ModelError("too small")
        return MapContactFinder(LSR1, terrain_from_point_cloud(cloud))

    intake = MapIntake(prepare, told.append, FRAMES)
    intake.offer(cloud_of(0.5))
    wait_until(lambda: told, "the refusal")
    assert told == ["too small"] and intake.take() is None
    intake.offer(b"\x00\x01\x00\x00" + b"\xff" * 40)
    wait_until(lambda: len(told) == 2, "the refusal of damaged bytes")
    assert "are no PointCloud2" in told[1] and "internal error" not in told[1]
    intake.offer(cloud_of(3.0))
    assert wait_until(intake.take, "a map") is not None
    intake.close()


def test_the_data_of_a_cloud_are_read_where_they_are():
    message = cloud_of(1.0)
    whole, read = deserialize_message(message, PointCloud2), read_message(message, PointCloud2)
    assert read.data.obj is message and read.data == whole.data
    assert is_same_cloud(read, whole) and is_same_cloud(whole, whole)
    for damaged in (message[:-9], message[:60], b""):
        with pytest.raises(MessageError, match="no PointCloud2"):
            read_message(damaged, PointCloud2)
