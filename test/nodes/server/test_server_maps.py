# SPDX-License-Identifier: Apache-2.0
"""A traverse server merges maps of both kinds, and fills the ground on which the rover stands."""

import time

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_to_point_cloud
from rover_physics import Terrain, save_terrain
from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.nodes import map_topics
from rover_planner.planning.answering.map_keeper import MapKeeper
from rover_planner.ros.qos import LATCHED_QOS
from support.grounds import make_terrain, wall_at, waves
from support.planner_client import SERVER, ask
from support.ros_fixtures import hear
from support.waiting import repeat_until, wait_until

PRIOR = make_terrain(waves)


def test_the_map_is_published_with_source_and_age_of_each_cell(server, client, tmp_path):
    file = tmp_path / "prior.npz"
    save_terrain(file, PRIOR)
    response = client.load_map(file)
    assert response.result == 0 and len(response.map.data) == PRIOR.elevation.size
    client.send_terrain(Terrain(np.full((20, 20), 0.5), 0.05, np.add(PRIOR.origin, 0.5)))
    heard = hear(client, PointCloud2, f"{SERVER}/map", LATCHED_QOS)
    wait_until(lambda: heard, "the map")
    cloud = heard[-1]
    names = [field.name for field in cloud.fields]
    assert names == ["x", "y", "z", "source", "age"] and cloud.header.frame_id == "map"
    values = np.frombuffer(cloud.data, "<f4").reshape(cloud.height, cloud.width, 5)
    merged = server.service.terrain.elevation
    np.testing.assert_array_equal(values[..., 2], merged.astype(np.float32))
    assert (values[10:30, 10:30, 3] == 4).all() and (values[31:, :, 3] == 1).all()
    assert values[..., 4].min() >= 0.0 and values[..., 4].max() < 60.0


def test_an_error_in_the_thread_of_the_published_map_is_counted_and_the_next_map_comes(
    server, client, monkeypatch
):
    heard = hear(client, PointCloud2, f"{SERVER}/map", LATCHED_QOS)
    with monkeypatch.context() as broken:
        broken.setattr(map_topics, "terrain_to_point_cloud", None)
        client.send_terrain(PRIOR)
        wait_until(lambda: server.guard.total, "the error")
    assert list(server.guard.counts) == ["_publish_map: TypeError"]
    client.send_terrain(make_terrain(wall_at(0.5)))
    wait_until(lambda: heard, "the next map")


@pytest.mark.timed
def test_a_question_waits_no_longer_than_20_ms_for_a_map_that_merges(
    start_server, client, tmp_path, hold
):
    file = tmp_path / "prior.npz"
    save_terrain(file, PRIOR)
    server = start_server(terrain_file=str(file), planner="fan")
    before = server.service.known_map.fingerprint
    began, go_on = hold(MapKeeper, "take")
    client.send_cloud(terrain_to_point_cloud(make_terrain(wall_at(0.5)), "map"))
    assert began.wait(20.0), "the map"
    assert ask(client)[1]["map_hash"] == before
    maps, start = server.desk._maps, time.monotonic()
    maps.wait(maps.last_job, lambda: None)
    # 5 ms by the clock; a busy machine wakes threads late
    assert 0.004 < time.monotonic() - start < 0.3
    go_on.set()
    wait_until(lambda: server.service.known_map.fingerprint != before, "the merged map")


def test_unknown_ground_under_the_standing_rover_is_filled(start_server, client):
    server = start_server(planner="fan", footprint_margin=0.1)
    client.send_terrain(make_terrain(lambda x, y: np.where(x < 0.0, np.nan, 0.0 * x)))
    start, goal = (-0.45, 0.0, 0.0), (2.0, 0.0, 0.0)
    before = server.service.known_map
    client.stand(start, height=0.3)  # of the body's origin of lsr1
    repeat_until(
        lambda: client.send_joints(SUSPENSION_JOINTS, 4 * [0.0]),
        lambda: any("ground under the rover filled" in line for line in client.logs),
        "the filled ground",
    )
    after = server.service.known_map
    assert (after.arrival, after.stamp) == (before.arrival, before.stamp)
    assert ask(client, start, goal)[1]["traversable"] == "true"
