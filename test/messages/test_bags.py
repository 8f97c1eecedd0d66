# SPDX-License-Identifier: Apache-2.0
"""Recorded maps are read: a GridMap of legged robots, Hazcam points of Spirit."""

import lzma
import os
from pathlib import Path

import pytest

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
