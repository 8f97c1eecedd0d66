"""Recorded maps are read: a GridMap that comes with grid_map, Hazcam points of Spirit."""

import os
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.grid_map import terrain_from_grid_map
from support.messages.grid_maps import move_buffer


def bag(name: str) -> Path:
    """Return the path of a recorded bag, which is no part of the package."""
    pytest.importorskip("rosbags")
    beside = Path(__file__).resolve().parents[3] / "shared" / "bags"
    path = Path(os.environ.get("ROVER_BAG_DIR", beside)) / name
    if not path.exists():
        pytest.skip(f"no bag {path}; set ROVER_BAG_DIR to its folder")
    return path


def test_the_grid_map_that_comes_with_grid_map_is_read():
    from rosbags.highlevel import AnyReader

    with AnyReader([bag("grid_map_demo/grid_map.bag")]) as reader:
        ((connection, _, raw),) = list(reader.messages())
        message = reader.deserialize(raw, connection.msgtype)
    terrain = terrain_from_grid_map(message)
    # 1.2 m along x and 3.6 m along y around (0, 0), cells of 3 cm
    assert terrain.elevation.shape == (120, 40) and terrain.resolution == 0.03
    assert terrain.origin == pytest.approx((-0.585, -1.785))
    known = np.isfinite(terrain.elevation)
    assert known.sum() == np.isfinite(message.data[0].data).sum() == 906
    assert terrain.elevation[known].min() == pytest.approx(-0.1)
    assert terrain.elevation[known].max() == pytest.approx(0.1)
    # The message's first value is that of the cell of largest x and y; rows run along -x.
    stored = message.data[0].data
    np.testing.assert_array_equal(terrain.elevation[-1, ::-1], stored[:40].astype(float))
    moved = terrain_from_grid_map(move_buffer(message, 11, 97))
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
