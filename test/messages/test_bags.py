# SPDX-License-Identifier: Apache-2.0
"""Recorded maps are read: a GridMap of legged robots, Hazcam points of Spirit."""

import lzma
import os
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.grid_map import terrain_from_grid_map
from support.messages.grid_maps import move_buffer

DATA = Path(__file__).resolve().parents[1] / "data"


def bag(name: str) -> Path:
    """Return the path of a recorded bag, which is no part of the package."""
    pytest.importorskip("rosbags")
    beside = Path(__file__).resolve().parents[3] / "shared" / "bags"
    path = Path(os.environ.get("ROVER_BAG_DIR", beside)) / name
    if not path.exists():
        pytest.skip(f"no bag {path}; set ROVER_BAG_DIR to its folder")
    return path


@pytest.fixture(scope="module")
def recorded_grid_map(tmp_path_factory):
    """Return the GridMap of a ROS 1 bag of traversability_estimation (test/data/README.md)."""
    pytest.importorskip("rosbags", reason="no rosbags: pip install '.[bags]'")
    from rosbags.highlevel import AnyReader

    file = tmp_path_factory.mktemp("bag") / "elevation_map.bag"
    file.write_bytes(lzma.decompress((DATA / "grid_map.bag.xz").read_bytes()))
    with AnyReader([file]) as reader:
        ((connection, _, raw),) = list(reader.messages())
        return reader.deserialize(raw, connection.msgtype)


def test_a_grid_map_of_legged_robots_is_read_from_its_bag(recorded_grid_map):
    terrain = terrain_from_grid_map(recorded_grid_map)
    # 3 m along x and 3.99 m along y around (0, 0), cells of 3 cm, all known
    assert terrain.elevation.shape == (133, 100) and terrain.resolution == 0.03
    assert terrain.origin == pytest.approx((-1.485, -1.98))
    (stored,) = (
        layer.data
        for name, layer in zip(recorded_grid_map.layers, recorded_grid_map.data, strict=True)
        if name == "elevation"
    )
    # Value k is that of row k % 100 and column k // 100; rows run along -x, columns along -y.
    for k in range(0, len(stored), 37):
        x, y = 1.485 - 0.03 * (k % 100), 1.98 - 0.03 * (k // 100)
        row, column = round((y + 1.98) / 0.03), round((x + 1.485) / 0.03)
        assert terrain.elevation[row, column] == stored[k]
    moved = terrain_from_grid_map(move_buffer(recorded_grid_map, 11, 97))
    assert moved.elevation.tobytes() == terrain.elevation.tobytes()


def test_hazcam_points_of_spirit_become_ground_with_the_height_that_was_asked_for():
    from rosbags.highlevel import AnyReader

    clouds = []
    with AnyReader([bag("mer_spirit_sol1352_hazcam_mcap")]) as reader:
        for connection, _, raw in reader.messages():
            assert connection.msgtype == "sensor_msgs/msg/PointCloud2"
            clouds.append(deserialize_message(bytes(raw), PointCloud2))
    assert [cloud.height * cloud.width for cloud in clouds] == [29_746, 24_880]
    for cloud in clouds:
        high, middle, mean = (
            terrain_from_point_cloud(cloud, 0.05, how) for how in ("max", "median", "mean")
        )
        known = np.isfinite(high.elevation)
        np.testing.assert_array_equal(known, np.isfinite(middle.elevation))
        assert (middle.elevation[known] <= high.elevation[known]).all()
        assert (mean.elevation[known] <= high.elevation[known] + 1e-12).all()
        # Stereo noise lifts the highest point of a cell, not the middle one.
        lifted = high.elevation[known] - middle.elevation[known]
        several = lifted > 0.0
        assert 0.1 < several.mean() < 0.9 and 0.002 < lifted[several].mean() < 0.1
        assert abs(np.mean(mean.elevation[known] - middle.elevation[known])) < 0.003
