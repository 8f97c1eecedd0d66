# SPDX-License-Identifier: Apache-2.0
"""GridMaps, made and recorded, become terrains cell by cell, wherever their buffer starts."""

import lzma
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msg_adapters.errors import MessageError
from msg_adapters.grid_map import GridMapLayers, terrain_from_grid_map
from support.messages import grid_map_of, set_field
from support.project.checkout import TOP

RNG = np.random.default_rng(3)
HEIGHTS = RNG.normal(0.0, 0.3, (7, 5)).astype(np.float32)
HEIGHTS[2, 3] = HEIGHTS[0, 1] = np.nan


def test_heights_ascend_along_x_and_y_from_the_cell_of_smallest_x_and_y():
    message = grid_map_of({"elevation": HEIGHTS}, 0.5, centre=(10.0, -4.0))
    message.info.pose.orientation.w = 0.0  # all zeros: not set, and taken as unturned
    terrain = terrain_from_grid_map(message)
    np.testing.assert_array_equal(terrain.elevation, HEIGHTS)
    # 5 columns along x and 7 rows along y, around the centre
    assert terrain.origin == (10.0 - 1.0, -4.0 - 1.5) and terrain.resolution == 0.5
    assert terrain.friction is None and terrain.elevation_std is None


@given(row=st.integers(0, 4), column=st.integers(0, 6), order=st.sampled_from("FC"))
def test_a_moved_buffer_start_gives_the_same_terrain_to_the_bit(row, column, order):
    layers = {"elevation": HEIGHTS, "variance": HEIGHTS**2, "friction": 0.5 + 0.0 * HEIGHTS}
    unmoved = grid_map_of(layers, 0.05, centre=(1.15, -0.35))
    moved = grid_map_of(layers, 0.05, (1.15, -0.35), order=order, start=(row, column))
    assert (row, column) == (0, 0) or list(moved.data[0].data) != list(unmoved.data[0].data)
    hashes = {terrain_from_grid_map(message).fingerprint for message in (moved, unmoved)}
    assert len(hashes) == 1


def test_variance_becomes_a_standard_deviation_and_friction_and_classes_stay():
    variance = np.full((7, 5), 0.0004, np.float32)
    friction = np.full((7, 5), 0.6, np.float32)
    friction[0, 0] = np.inf
    classes = np.full((7, 5), 2.0, np.float32)
    classes[0, 0] = -1.0
    layers = {"h": HEIGHTS, "s2": variance, "mu": friction, "elevation": variance}
    message = grid_map_of(layers | {"class": classes})
    terrain = terrain_from_grid_map(message, GridMapLayers("h", "s2", "mu"))
    known = np.isfinite(HEIGHTS)
    np.testing.assert_allclose(terrain.elevation_std[known], 0.02, rtol=1e-6)
    assert np.isnan(terrain.elevation_std[~known]).all()
    assert np.isnan(terrain.friction[0, 0]) and terrain.friction[1, 1] == np.float32(0.6)
    assert np.isnan(terrain.ground_class[0, 0]) and terrain.ground_class[1, 1] == 2.0


def test_a_cell_that_a_basic_layer_or_the_variance_lacks_is_unknown():
    seen = np.ones((7, 5), np.float32)
    seen[4, 4] = np.nan
    variance = np.ones((7, 5), np.float32)
    variance[5, 0] = np.inf
    layers = {"elevation": HEIGHTS, "seen": seen, "variance": variance}
    terrain = terrain_from_grid_map(grid_map_of(layers, basic=("elevation", "seen")))
    expected = np.isnan(HEIGHTS)
    expected[4, 4] = expected[5, 0] = True
    np.testing.assert_array_equal(np.isnan(terrain.elevation), expected)


TURN = SimpleNamespace(x=0.0, y=0.0, z=0.1, w=0.995)


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("info.pose.orientation", TURN, "grid map is turned"),
        ("layers", ["height"], "no layer 'elevation'; it has height: set elevation_layer"),
        ("layers", ["elevation", "elevation"], "2 layers and 1 arrays"),
        ("basic_layers", ["seen"], "basic layer 'seen'"),
        ("info.length_x", 0.26, "length_x 0.26"),
        ("info.length_y", float("nan"), "length_y nan"),
        ("info.resolution", 0.0, "resolution 0.0"),
        ("info.length_x", 1e6, "at most 25000000"),
        ("outer_start_index", 5, "starts at row 5"),
        ("data.0.data", HEIGHTS.ravel()[:-1], "34 values"),
        ("data.0.layout.data_offset", 2, "37"),
        ("data.0.layout.dim.0.label", "rows", "dimensions ['rows', 'row_index']"),
        ("data.0.layout.dim.0.size", 5, "sizes [5, 5]"),
        ("data.0.layout.dim", [], "dimensions []"),
        ("data.0.data", np.full(35, np.nan, np.float32), "none of the grid map's 35"),
    ],
)
def test_a_bad_grid_map_is_refused_by_name(path, value, text):
    message = grid_map_of({"elevation": HEIGHTS}, 0.05)
    set_field(message, path, value)
    with pytest.raises(MessageError, match=re.escape(text)):
        terrain_from_grid_map(message)


def test_a_grid_map_of_legged_robots_is_read_from_its_bag(tmp_path):
    """The bag is a ROS 1 bag of traversability_estimation (test/data/README.md)."""
    pytest.importorskip("rosbags", reason="no rosbags: pip install '.[bags]'")
    from rosbags.highlevel import AnyReader

    file = tmp_path / "elevation_map.bag"
    file.write_bytes(lzma.decompress((TOP / "test" / "data" / "grid_map.bag.xz").read_bytes()))
    with AnyReader([file]) as reader:
        ((connection, _, raw),) = list(reader.messages())
        recorded = reader.deserialize(raw, connection.msgtype)
    terrain = terrain_from_grid_map(recorded)
    # 3 m along x and 3.99 m along y around (0, 0), cells of 3 cm, all known
    assert terrain.elevation.shape == (133, 100) and terrain.resolution == 0.03
    assert terrain.origin == pytest.approx((-1.485, -1.98))
    stored = recorded.data[recorded.layers.index("elevation")].data
    # Value k is that of row k % 100 and column k // 100; rows run along -x, columns along -y.
    for k in range(0, len(stored), 37):
        x, y = 1.485 - 0.03 * (k % 100), 1.98 - 0.03 * (k // 100)
        row, column = round((y + 1.98) / 0.03), round((x + 1.485) / 0.03)
        assert terrain.elevation[row, column] == stored[k]
