# SPDX-License-Identifier: Apache-2.0
"""Clouds in the frame of a sensor become the map that the same cloud in the map frame becomes."""

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointField

from msg_adapters.elevation import terrain_to_point_cloud
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.navigation.transforms import Rigid
from support.grounds import make_terrain, rocky
from support.waiting import wait_until

ROBOT = Rigid.from_rpy(0.7, -0.4, 0.25, 0.03, -0.06, 0.8)
"""Where the rover stands."""
MOUNT = Rigid.from_rpy(0.3, 0.05, 0.45, 0.0, 0.5, -0.1)
ENTRY = "front_camera:0.3:0.05:0.45:0.0:0.5:-0.1"
CELL = 0.05


@pytest.fixture
def camera_server(start_server):
    """Return a server that knows how a camera is mounted."""
    return start_server(sensor_mounts=[ENTRY], map_resolution=CELL, transform_timeout=30.0)


def points_of(terrain: Terrain) -> np.ndarray:
    """Return a point (n, 3) somewhere in each cell, as a camera has them."""
    rows, columns = np.indices(terrain.elevation.shape)
    rng = np.random.default_rng(3)
    x, y = (
        start + CELL * (index + rng.uniform(-0.3, 0.3, index.shape))
        for start, index in zip(terrain.origin, (columns, rows), strict=True)
    )
    return np.column_stack([x.ravel(), y.ravel(), terrain.elevation.ravel()])


def cloud_of(points: np.ndarray, frame: str, stamp) -> object:
    """Return an unorganised cloud of points (n, 3) in float32."""
    cloud = terrain_to_point_cloud(Terrain(np.zeros((2, 2)), 1.0, (0.0, 0.0)), frame, stamp)
    cloud.height, cloud.width = 1, len(points)
    cloud.row_step = cloud.point_step * cloud.width
    cloud.data = points.astype("<f4").tobytes()
    assert cloud.fields[0].datatype == PointField.FLOAT32
    return cloud


def send_odometry(client, stamp) -> None:
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id, message.header.stamp = "map", stamp
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    place.x, place.y, place.z = ROBOT.translation.tolist()
    turn.x, turn.y, turn.z, turn.w = ROBOT.rotation.as_quat().tolist()
    client.send(client._odometry, message)


def test_a_cloud_of_a_camera_gives_the_map_of_the_same_cloud_in_the_map_frame(
    camera_server, client, lasting
):
    points = points_of(make_terrain(rocky))
    now = client.get_clock().now().to_msg()
    client.send_cloud(cloud_of(points, "map", now))
    wait_until(lambda: camera_server.service.terrain is not None, "the map")
    right = camera_server.service.terrain
    send_odometry(client, now)
    wait_until(lambda: camera_server.service.fresh_pose() is not None, "odometry")
    back = ROBOT.then(MOUNT).inverse()
    seen = back.rotation.apply(points) + back.translation
    assert np.abs(seen - points).max() > 1.0
    client.send_cloud(cloud_of(seen, "front_camera", now))
    wait_until(lambda: camera_server.service.terrain is not right, "the camera's map")
    found = camera_server.service.terrain
    assert (found.resolution, found.elevation.shape) == (CELL, right.elevation.shape)
    np.testing.assert_allclose(found.origin, right.origin, atol=1e-9)
    np.testing.assert_allclose(found.elevation, right.elevation, atol=2e-6)
    assert np.isfinite(found.elevation).mean() > 0.99
