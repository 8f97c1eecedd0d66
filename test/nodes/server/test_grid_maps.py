# SPDX-License-Identifier: Apache-2.0
"""GridMaps: their layers are used, and those of other frames are placed by /tf."""

from functools import partial

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile

from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros import map_intake
from rover_planner.ros.qos import map_qos
from support.grounds import make_terrain, waves
from support.messages.grid_maps import grid_map_of, move_buffer, to_message
from support.messages.interfaces import GRID_MAP_MSGS, TF2_MSGS, importable
from support.messages.transforms import send_transforms, transform_message
from support.planner_client import ask
from support.waiting import wait_until

PRIOR = make_terrain(waves)
CELL = PRIOR.resolution
REFUSED = "elevation_map refused, there is no map yet: "
X0, X1, Y0, Y1 = PRIOR.bounds
CENTRE = 0.5 * (X0 + X1), 0.5 * (Y0 + Y1)


@pytest.mark.long  # builds two packages of messages
def test_layers_and_transforms_are_the_map_over_dds(tmp_path, start_server, client):
    with (
        importable("grid_map_msgs", GRID_MAP_MSGS, tmp_path / "grid_map") as grid_map,
        importable("tf2_msgs", TF2_MSGS, tmp_path / "tf2") as tf2,
    ):
        server = start_server(
            planner="fan", elevation_layer="height", variance_layer="none", friction_layer="mu"
        )
        maps = client.create_publisher(grid_map.GridMap, "elevation_map", map_qos())
        static = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        tf = client.create_publisher(tf2.TFMessage, "/tf_static", static)
        wait_until(lambda: maps.get_subscription_count() == 2, "the subscriptions")
        layers = {"height": PRIOR.elevation, "variance": np.full(PRIOR.elevation.shape, 4.0)}
        plain = grid_map_of(layers, CELL)
        maps.publish(to_message(grid_map.GridMap, move_buffer(plain, 17, 130)))
        first = wait_until(lambda: server.service.known_map, "the map")
        np.testing.assert_array_equal(first.terrain.elevation, PRIOR.elevation)
        assert first.terrain.origin == pytest.approx(PRIOR.origin, abs=1e-9)
        assert (first.source, first.frame) == ("elevation_map", "map")
        assert first.terrain.elevation_std is None
        assert ask(client)[1]["traversable"] == "true"
        slippery = grid_map_of(layers | {"mu": 0.01 + 0.0 * PRIOR.elevation}, CELL)
        maps.publish(to_message(grid_map.GridMap, slippery))
        wait_until(lambda: server.service.known_map is not first, "the second map")
        assert ask(client)[1]["code"] == "friction"
        lifted, now = Rigid.from_rpy(0, 0, 1.0, 0, 0, 0), client.get_clock().now().to_msg()
        tf.publish(tf2.TFMessage(transforms=[transform_message("map", "odom", lifted, now)]))
        wait_until(lambda: server.frames._tree.knows("odom"), "/tf_static")
        maps.publish(to_message(grid_map.GridMap, plain, "odom", now))
        wait_until(lambda: server.service.terrain.elevation.min() > 0.5, "the lifted map")


@pytest.fixture
def offer(monkeypatch):
    """Return a function that gives a server a GridMap, whose package is not on PyPI."""
    messages = {}
    monkeypatch.setattr(map_intake, "read_message", lambda raw, _: messages[raw])

    def offer_map(server, frame="odom"):
        message = grid_map_of({"elevation": PRIOR.elevation}, CELL, CENTRE)
        message.header.frame_id = frame
        messages[bytes([len(messages)])] = move_buffer(message, 5, 3)
        server._maps._intake.offer(bytes([len(messages) - 1]), type(message))

    return offer_map


def test_a_map_is_refused_with_the_reason_until_its_transform_has_come(
    start_server, client, offer
):
    server = start_server(transform_timeout=30.0)
    take = server.frames.take
    offer(server, frame="")
    client.wait_for_log(f"{REFUSED}elevation_map is without a frame_id; it must be in 'map'")
    send_transforms(server, take, ("map", "odom", Rigid.none()), age=100.0)
    offer(server)
    client.wait_for_log(f"{REFUSED}the transform from 'odom' to 'map' is stale: it is 10")
    send_transforms(server, take, ("map", "tilted", Rigid.from_rpy(0, 0, 0, 0.03, 0.04, 0)), age=0)
    offer(server, frame="tilted")
    client.wait_for_log(f"{REFUSED}the frame of the map leans by 0.05 rad (roll and pitch)")
    offer(server, frame="moon")
    client.wait_for_log(
        f"{REFUSED}the message is in frame 'moon'; it must be in 'map', or in a frame of /tf or "
        "sensor_mounts; known are base_link"
    )
    assert server.service.terrain is None
    send_transforms(server, take, ("map", "moon", Rigid.from_rpy(0, 0, 1.0, 0, 0, 0)), age=0)
    wait_until(lambda: server.service.terrain is not None, "the map")
    right = PRIOR.elevation.astype(np.float32) + 1.0
    np.testing.assert_allclose(server.service.terrain.elevation, right, atol=1e-12)


def test_a_turned_map_in_odom_is_the_same_ground_in_the_map_frame(start_server, offer):
    server = start_server(transform_timeout=30.0)
    here = Rigid.from_rpy(12.0, -7.0, 0.4, 0.0, 0.0, 0.7)
    send_transforms(
        server, partial(server.frames.take, is_static=True), ("map", "odom", here), age=0.0
    )
    offer(server)
    found = wait_until(lambda: server.service.terrain, "the map")
    rows, columns = np.nonzero(np.isfinite(found.elevation))
    at = np.column_stack([
        found.origin[0] + CELL * columns, found.origin[1] + CELL * rows, 0.0 * rows
    ])  # fmt: skip
    own = here.inverse().rotation.apply(at) + here.inverse().translation
    right = PRIOR.elevation_at(own[:, 0], own[:, 1]) + 0.4
    np.testing.assert_allclose(found.elevation[rows, columns], right, atol=1e-6)
    assert 0.95 * PRIOR.elevation.size < len(rows) <= PRIOR.elevation.size
