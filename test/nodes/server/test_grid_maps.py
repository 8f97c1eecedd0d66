# SPDX-License-Identifier: Apache-2.0
"""GridMaps over DDS: their layers are used, and those of other frames are placed by /tf."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile

from rover_physics.terrain.grid import Terrain
from rover_planner.nodes.maps import map_topics
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.qos import map_qos
from support.grounds import make_terrain, waves
from support.messages.grid_maps import grid_map_of, move_buffer, to_message
from support.messages.interfaces import GRID_MAP_MSGS, TF2_MSGS, importable
from support.messages.transforms import transform_message
from support.planner_client import ask
from support.waiting import wait_until

PRIOR = make_terrain(waves)
CELL = PRIOR.resolution
REFUSED = "elevation_map refused, there is no map yet: "


@pytest.fixture(scope="module")
def grid_map_msgs(tmp_path_factory):
    """Return grid_map_msgs.msg, built for these tests where it is not installed."""
    folder = tmp_path_factory.mktemp("grid_map")
    with importable("grid_map_msgs", GRID_MAP_MSGS, folder) as messages:
        yield messages


@pytest.fixture(scope="module")
def tf2_msgs(tmp_path_factory):
    """Return tf2_msgs.msg, built for these tests where it is not installed."""
    with importable("tf2_msgs", TF2_MSGS, tmp_path_factory.mktemp("tf2")) as messages:
        yield messages


def test_layers_of_a_grid_map_with_a_moved_buffer_are_the_map_over_dds(
    grid_map_msgs, start_server, client
):
    server = start_server(
        planner="fan", elevation_layer="height", variance_layer="none", friction_layer="mu"
    )
    publisher = client.create_publisher(grid_map_msgs.GridMap, "elevation_map", map_qos())
    wait_until(lambda: publisher.get_subscription_count() == 2, "the subscriptions")
    layers = {"height": PRIOR.elevation, "variance": np.full(PRIOR.elevation.shape, 4.0)}
    plain = grid_map_of(layers, PRIOR.resolution)
    publisher.publish(to_message(grid_map_msgs.GridMap, move_buffer(plain, 17, 130)))
    first = wait_until(lambda: server.service.known_map, "the map")
    np.testing.assert_array_equal(first.terrain.elevation, PRIOR.elevation)
    assert first.terrain.origin == pytest.approx(PRIOR.origin, abs=1e-9)
    assert (first.source, first.frame) == ("elevation_map", "map")
    assert first.terrain.elevation_std is None
    _, verdict, _ = ask(client)
    assert verdict["traversable"] == "true" and verdict["blind_share"] == "0.0"
    slippery = grid_map_of(layers | {"mu": 0.01 + 0.0 * PRIOR.elevation}, PRIOR.resolution)
    publisher.publish(to_message(grid_map_msgs.GridMap, slippery))
    wait_until(lambda: server.service.known_map is not first, "the second map")
    assert ask(client)[1]["code"] == "friction"
    # A map that cannot be used is refused by the name of its topic, and the last one stays.
    turned = to_message(grid_map_msgs.GridMap, plain)
    turned.info.pose.orientation.z, turned.info.pose.orientation.w = 0.1, 0.995
    publisher.publish(turned)
    client.wait_for_log("elevation_map refused, the last good map stays: grid map is turned")


def test_without_grid_map_msgs_the_server_has_no_such_topic(start_server, monkeypatch):
    monkeypatch.setattr(map_topics, "grid_map_type", lambda: None)
    server = start_server()
    topics = {name for name, _ in server.get_topic_names_and_types()}
    assert "/elevation_cloud" in topics and "/elevation_map" not in topics


class Robot:
    """What publishes GridMaps and transforms, as elevation_mapping and a localisation do."""

    def __init__(self, node, grid_map: type, transforms: type):
        self.node, self._grid_map, self._transforms = node, grid_map, transforms
        static = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._maps = node.create_publisher(grid_map, "elevation_map", map_qos())
        self._moving = node.create_publisher(transforms, "/tf", 10)
        self._static = node.create_publisher(transforms, "/tf_static", static)

    def is_heard(self) -> bool:
        return (
            self._maps.get_subscription_count() == 2 == 1 + self._moving.get_subscription_count()
        )

    def send_map(self, terrain: Terrain, frame: str = "odom", stamp: Time | None = None) -> None:
        """Publish the layers of a terrain that has an odd number of cells."""
        layers = {"elevation": terrain.elevation}
        if terrain.elevation_std is not None:
            layers["variance"] = terrain.elevation_std**2
        if terrain.friction is not None:
            layers["friction"] = terrain.friction
        x0, x1, y0, y1 = terrain.bounds
        centre = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        stamp = self.node.get_clock().now().to_msg() if stamp is None else stamp
        plain = move_buffer(grid_map_of(layers, terrain.resolution, centre), 5, 3)
        self._maps.publish(to_message(self._grid_map, plain, frame, stamp))

    def send_transform(self, rigid: Rigid, age: float = 0.0, *, is_static: bool = False) -> None:
        """Tell where odom is on the map, at a time that is past [s]."""
        stamp = (self.node.get_clock().now() - Duration(seconds=age)).to_msg()
        message = self._transforms(transforms=[transform_message("map", "odom", rigid, stamp)])
        (self._static if is_static else self._moving).publish(message)


@pytest.fixture
def robot(client, grid_map_msgs, tf2_msgs):
    return Robot(client, grid_map_msgs.GridMap, tf2_msgs.TFMessage)


def test_a_turned_map_in_odom_is_the_same_ground_in_the_map_frame(robot, start_server):
    server = start_server(transform_timeout=30.0)
    wait_until(robot.is_heard, "the subscriptions")
    here = Rigid.from_rpy(12.0, -7.0, 0.4, 0.0, 0.0, 0.7)
    robot.send_transform(here, is_static=True)
    wait_until(lambda: server.frames._tree.knows("odom"), "/tf_static")
    robot.send_map(PRIOR)
    wait_until(lambda: server.service.terrain is not None, "the map")
    found = server.service.terrain
    rows, columns = np.nonzero(np.isfinite(found.elevation))
    at = np.column_stack([
        found.origin[0] + CELL * columns, found.origin[1] + CELL * rows, 0.0 * rows
    ])  # fmt: skip
    own = here.inverse().rotation.apply(at) + here.inverse().translation
    right = PRIOR.elevation_at(own[:, 0], own[:, 1]) + 0.4
    np.testing.assert_allclose(found.elevation[rows, columns], right, atol=1e-6)
    assert 0.95 * PRIOR.elevation.size < len(rows) <= PRIOR.elevation.size


def test_a_map_whose_transform_is_missing_stale_or_leans_is_refused_with_the_reason(
    robot, start_server, client
):
    server = start_server(transform_timeout=30.0)
    wait_until(robot.is_heard, "the subscriptions")
    robot.send_map(PRIOR)
    client.wait_for_log(
        f"{REFUSED}the message is in frame 'odom'; it must be in 'map', or in a frame of /tf or "
        "sensor_mounts; known are base_link"
    )
    robot.send_transform(Rigid.none(), age=100.0)
    wait_until(lambda: server.frames._tree.knows("odom"), "/tf")
    robot.send_map(PRIOR)
    client.wait_for_log(f"{REFUSED}the transform from 'odom' to 'map' is stale: it is 10")
    edge = server.frames._tree._edges["odom"]
    old = edge.newest
    robot.send_transform(Rigid.from_rpy(0.0, 0.0, 0.0, 0.03, 0.04, 0.0))
    wait_until(lambda: edge.newest > old, "/tf")
    robot.send_map(PRIOR)
    client.wait_for_log(f"{REFUSED}the frame of the map leans by 0.05 rad (roll and pitch)")
    robot.send_map(PRIOR, frame="")
    client.wait_for_log(f"{REFUSED}elevation_map is without a frame_id; it must be in 'map'")
    assert server.service.terrain is None


def test_a_map_that_comes_before_its_transform_is_taken_when_that_has_come(
    robot, start_server, client
):
    server = start_server(transform_timeout=30.0)
    wait_until(robot.is_heard, "the subscriptions")
    robot.send_map(PRIOR)
    client.wait_for_log(f"{REFUSED}the message is in frame 'odom'")
    robot.send_transform(Rigid.from_rpy(0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    wait_until(lambda: server.service.terrain is not None, "the map")
    right = PRIOR.elevation.astype(np.float32) + 1.0
    np.testing.assert_allclose(server.service.terrain.elevation, right, atol=1e-12)
