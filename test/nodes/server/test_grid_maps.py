# SPDX-License-Identifier: Apache-2.0
"""GridMaps: their layers are used, and those of other frames are placed by /tf."""

from functools import partial

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

    def offer_map(server, frame="odom", name="elevation", **others):
        message = grid_map_of({name: PRIOR.elevation} | others, CELL, CENTRE)
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
    layers = {"elevation_layer": "height", "variance_layer": "none", "friction_layer": "mu"}
    server = start_server(transform_timeout=30.0, **layers)
    here = Rigid.from_rpy(12.0, -7.0, 0.4, 0.0, 0.0, 0.7)
    send_transforms(
        server, partial(server.frames.take, is_static=True), ("map", "odom", here), age=0.0
    )
    ones = np.ones(PRIOR.elevation.shape)
    offer(server, name="height", variance=4.0 * ones, mu=0.3 * ones)
    found = wait_until(lambda: server.service.terrain, "the map")
    assert found.elevation_std is None and np.nanmax(found.friction) == pytest.approx(0.3)
    rows, columns = np.nonzero(np.isfinite(found.elevation))
    at = np.column_stack([
        found.origin[0] + CELL * columns, found.origin[1] + CELL * rows, 0.0 * rows
    ])  # fmt: skip
    own = here.inverse().rotation.apply(at) + here.inverse().translation
    right = PRIOR.elevation_at(own[:, 0], own[:, 1]) + 0.4
    np.testing.assert_allclose(found.elevation[rows, columns], right, atol=1e-6)
    assert 0.95 * PRIOR.elevation.size < len(rows) <= PRIOR.elevation.size
