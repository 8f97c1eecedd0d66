# SPDX-License-Identifier: Apache-2.0
"""GridMaps: their layers are used; those of other frames are placed by /tf, mount, odometry."""

import numpy as np
import pytest

from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros import map_intake
from support.grounds import make_terrain, waves
from support.messages.grid_maps import grid_map_of, move_buffer
from support.messages.transforms import send_transforms
from support.waiting import wait_until

PRIOR = make_terrain(waves)
CELL = PRIOR.resolution
REFUSED = "elevation_map refused, there is no map yet: "
X0, X1, Y0, Y1 = PRIOR.bounds
CENTRE = 0.5 * (X0 + X1), 0.5 * (Y0 + Y1)


@pytest.fixture
def offer(monkeypatch):
    """Return a function that gives a server a GridMap, whose package is not on PyPI."""
    messages = {}
    monkeypatch.setattr(map_intake, "read_message", lambda raw, _: messages[raw])

    def offer_map(server, frame="odom"):
        ones = np.ones(PRIOR.elevation.shape)
        layers = {"height": PRIOR.elevation, "variance": 4.0 * ones, "mu": 0.3 * ones}
        message = grid_map_of(layers, CELL, CENTRE, basic=("height",))
        message.header.frame_id = frame
        messages[bytes([len(messages)])] = move_buffer(message, 5, 3)
        server._maps._intake.offer(bytes([len(messages) - 1]), type(message))

    return offer_map


def test_a_map_is_refused_with_the_reason_until_its_transform_has_come(
    start_server, client, offer
):
    layers = {"elevation_layer": "height", "variance_layer": "none", "friction_layer": "mu"}
    server = start_server(transform_timeout=30.0, **layers)
    take = server.frames.take
    offer(server, frame="")
    client.wait_for_log(f"{REFUSED}elevation_map is without a frame_id; it must be in 'map'")
    offer(server, frame="moon")
    client.wait_for_log(
        f"{REFUSED}the message is in frame 'moon'; it must be in 'map', or in a frame of /tf or "
        "sensor_mounts; known are base_link"
    )
    assert server.service.terrain is None
    send_transforms(server, take, ("map", "moon", Rigid.from_rpy(0, 0, 1.0, 0, 0, 0)), age=0)
    wait_until(lambda: server.service.terrain is not None, "the map")
    found, right = server.service.terrain, PRIOR.elevation.astype(np.float32) + 1.0
    np.testing.assert_allclose(found.elevation, right, atol=1e-12)
    assert found.elevation_std is None and found.friction.max() == pytest.approx(0.3)


def test_a_map_of_a_sensor_is_placed_by_its_mount_and_odometry(
    start_server, client, offer, lasting
):
    layers = {"elevation_layer": "height", "friction_layer": "none", "variance_layer": "none"}
    server = start_server(
        sensor_mounts=["scanner:0.0:0.0:0.5:0.0:0.0:0.0"], transform_timeout=30.0, **layers
    )
    client.send_odometry((2.0, -1.0, 0.0))
    wait_until(lambda: server.service.fresh_pose() is not None, "odometry")
    offer(server, frame="scanner")
    found = wait_until(lambda: server.service.terrain, "the map")
    assert found.origin == pytest.approx(np.add(PRIOR.origin, (2.0, -1.0)))
    np.testing.assert_allclose(found.elevation, PRIOR.elevation + 0.5, atol=1e-6)
