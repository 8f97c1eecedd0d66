"""Clouds become terrains cell by cell, and bad clouds are refused by name."""

import array
from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.elevation import (
    PointMove,
    read_points,
    terrain_from_point_cloud,
    terrain_to_occupancy_grid,
    terrain_to_point_cloud,
)
from msg_adapters.errors import MessageError
from msg_adapters.gridding import detect_raster
from rover_physics.errors import TerrainError
from rover_physics.terrain.grid import Terrain

FLOAT32, FLOAT64 = PointField.FLOAT32, PointField.FLOAT64


def rough_terrain(resolution=0.05, origin=(-1.2, 3.4), shape=(7, 11), seed=1):
    """Return a terrain of float32 heights with gaps, one of them at the edge."""
    heights = np.random.default_rng(seed).normal(0.0, 0.3, shape)
    elevation = heights.astype(np.float32).astype(np.float64)
    elevation[2, 3] = elevation[0, 5] = np.nan
    return Terrain(elevation, resolution, origin)


def cloud_of(points, names=("x", "y", "z"), kind="<f4", gap=0, height=1, row_padding=0):
    """Lay out points (n, k) as a cloud with `gap` bytes before each field and padded rows."""
    points = np.asarray(points, dtype=np.float64)
    size = np.dtype(kind).itemsize
    step = len(names) * (size + gap) + gap
    width = len(points) // height
    raw = np.full((height, width * step + row_padding), 0xFF, np.uint8)
    for i in range(len(names)):
        offset = gap + i * (size + gap)
        values = points[:, i].astype(kind).view(np.uint8).reshape(height, width, size)
        for row in range(height):
            for column in range(width):
                at = column * step + offset
                raw[row, at : at + size] = values[row, column]
    cloud = PointCloud2(height=height, width=width, point_step=step, row_step=raw.shape[1])
    cloud.is_bigendian = kind[0] == ">"
    cloud.fields = [
        PointField(
            name=name,
            offset=gap + i * (size + gap),
            count=1,
            datatype=FLOAT32 if size == 4 else FLOAT64,
        )
        for i, name in enumerate(names)
    ]
    cloud.data = array.array("B", raw.tobytes())
    return cloud


def points_of(terrain):
    """Return (n, 3) all cells of a terrain, row by row."""
    rows, columns = terrain.elevation.shape
    x = terrain.origin[0] + terrain.resolution * np.arange(columns)
    y = terrain.origin[1] + terrain.resolution * np.arange(rows)
    grid_x, grid_y = np.meshgrid(x, y)
    return np.column_stack([grid_x.ravel(), grid_y.ravel(), terrain.elevation.ravel()])


def assert_same(terrain, expected):
    np.testing.assert_array_equal(terrain.elevation, expected.elevation)
    assert terrain.resolution == expected.resolution
    assert terrain.origin == expected.origin


@pytest.mark.parametrize("datatype", [FLOAT32, FLOAT64])
def test_a_terrain_comes_back_as_it_was(datatype):
    terrain = rough_terrain()
    assert_same(
        terrain_from_point_cloud(terrain_to_point_cloud(terrain, "map", None, datatype)), terrain
    )


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(2, 40),
    columns=st.integers(2, 40),
    millimetres=st.integers(5, 1000),
    corner=st.tuples(st.integers(-90_000, 90_000), st.integers(-90_000, 90_000)),
)
def test_any_grid_in_millimetres_comes_back_as_it_was(rows, columns, millimetres, corner):
    origin = (corner[0] / 1000, corner[1] / 1000)
    elevation = np.arange(rows * columns, dtype=np.float64).reshape(rows, columns)
    terrain = Terrain(elevation, millimetres / 1000, origin)
    assert_same(terrain_from_point_cloud(terrain_to_point_cloud(terrain, "map")), terrain)


@pytest.mark.parametrize("name", ["spirit", "erc_marsyard2021_9cm", "otira_tls_boulders_3cm"])
def test_a_real_map_comes_back_as_it_was(real_map, name):
    terrain = real_map(name)
    back = terrain_from_point_cloud(terrain_to_point_cloud(terrain, "map"))
    np.testing.assert_array_equal(back.elevation, terrain.elevation)
    assert back.resolution == pytest.approx(terrain.resolution, abs=1e-8)
    assert back.origin == pytest.approx(terrain.origin, abs=1e-5)


def test_friction_comes_back_where_the_cloud_has_it():
    plain = rough_terrain()
    friction = np.full(plain.elevation.shape, 0.75)
    friction[1, 1] = 0.25
    terrain = Terrain(plain.elevation, plain.resolution, plain.origin, friction)
    back = terrain_from_point_cloud(terrain_to_point_cloud(terrain, "map"))
    known = np.isfinite(plain.elevation)
    np.testing.assert_array_equal(back.friction[known], friction[known])


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8", ">f8"])
@pytest.mark.parametrize("gap", [0, 3])
@pytest.mark.parametrize(("height", "row_padding"), [(1, 0), (1, 5), (7, 0), (7, 9)])
def test_layout_does_not_change_the_terrain(kind, gap, height, row_padding):
    terrain = rough_terrain()
    cloud = cloud_of(points_of(terrain), ("x", "y", "z"), kind, gap, height, row_padding)
    assert_same(terrain_from_point_cloud(cloud), terrain)


def test_order_of_points_and_fields_does_not_change_the_terrain():
    terrain = rough_terrain()
    points = np.random.default_rng(3).permutation(points_of(terrain))
    mixed = np.column_stack([points[:, 2], np.ones(len(points)), points[:, 1], points[:, 0]])
    cloud = cloud_of(mixed, ("z", "intensity", "y", "x"))
    assert_same(terrain_from_point_cloud(cloud), terrain)


@pytest.mark.parametrize("height", [1, 7])
@pytest.mark.parametrize("x_step", [1, -1])
@pytest.mark.parametrize("y_step", [1, -1])
def test_a_map_is_taken_as_it_comes_whichever_way_its_rows_run(height, x_step, y_step):
    terrain = rough_terrain()
    rows = points_of(terrain).reshape(7, 11, 3)[::y_step, ::x_step]
    assert detect_raster(rows[:, :, 0], rows[:, :, 1]) is not None
    assert_same(terrain_from_point_cloud(cloud_of(rows.reshape(-1, 3), height=height)), terrain)
    columns = rows.transpose(1, 0, 2)
    assert detect_raster(columns[:, :, 0], columns[:, :, 1]) is not None
    assert_same(terrain_from_point_cloud(cloud_of(columns.reshape(-1, 3))), terrain)


def test_what_is_no_complete_map_is_not_taken_for_one():
    rows = points_of(rough_terrain()).reshape(7, 11, 3)
    shifted, unplaced = rows.copy(), rows.copy()
    shifted[3, 4, 0] += 0.01
    unplaced[3, 4, :2] = np.nan
    twice = np.repeat(rows, 2, axis=1)
    gap = np.delete(rows, 3, axis=1)
    uneven = rows + np.array([0.02, 0.0, 0.0]) * (np.arange(11) > 5)[:, None]
    for points in (shifted, unplaced, twice, gap, uneven):
        assert detect_raster(points[:, :, 0], points[:, :, 1]) is None
    expected = rough_terrain().elevation.copy()
    expected[3, 4] = np.nan
    terrain = terrain_from_point_cloud(cloud_of(unplaced.reshape(-1, 3), height=7))
    np.testing.assert_array_equal(terrain.elevation, expected)


def test_a_map_without_any_height_is_refused():
    rows = points_of(rough_terrain())
    rows[:, 2] = np.nan
    with pytest.raises(MessageError, match="none of the cloud's 77 points"):
        terrain_from_point_cloud(cloud_of(rows, height=7))


def test_missing_points_are_unknown_ground():
    terrain = rough_terrain()
    points = points_of(terrain)
    left_out = points[np.isfinite(points[:, 2])]
    assert_same(terrain_from_point_cloud(cloud_of(left_out)), terrain)
    infinite = points.copy()
    infinite[np.isnan(points[:, 2]), 2] = np.inf
    assert_same(terrain_from_point_cloud(cloud_of(infinite)), terrain)
    unplaced = points.copy()
    unplaced[np.isnan(points[:, 2])] = np.nan
    assert_same(terrain_from_point_cloud(cloud_of(unplaced)), terrain)


def test_a_missing_column_leaves_unknown_cells():
    terrain = rough_terrain()
    points = points_of(terrain)
    points = points[np.abs(points[:, 0] - (terrain.origin[0] + 4 * terrain.resolution)) > 1e-6]
    back = terrain_from_point_cloud(cloud_of(points))
    assert back.elevation.shape == terrain.elevation.shape
    assert np.isnan(back.elevation[:, 4]).all()


def test_a_turned_or_mirrored_cloud_gives_the_turned_or_mirrored_terrain():
    terrain = rough_terrain(origin=(1.0, 2.0))
    points = points_of(terrain)
    turned = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    np.testing.assert_array_equal(
        terrain_from_point_cloud(cloud_of(turned)).elevation, terrain.elevation.T[:, ::-1]
    )
    mirrored = points * [1.0, -1.0, 1.0]
    back = terrain_from_point_cloud(cloud_of(mirrored))
    np.testing.assert_array_equal(back.elevation, terrain.elevation[::-1])
    assert back.origin == pytest.approx((1.0, -2.3))


def test_the_given_resolution_keeps_the_cells_of_a_grid_of_that_resolution():
    terrain = rough_terrain(resolution=0.05, origin=(0.013, -0.021))
    assert_same(terrain_from_point_cloud(cloud_of(points_of(terrain)), 0.05), terrain)


def test_irregular_points_fall_on_multiples_of_the_resolution():
    points = [[0.11, 0.01, 1.0], [0.29, -0.02, 2.0], [0.12, 0.53, 3.0]]
    terrain = terrain_from_point_cloud(cloud_of(points), 0.1)
    assert terrain.origin == pytest.approx((0.1, 0.0))
    expected = np.full((6, 3), np.nan)
    expected[0, 0], expected[0, 2], expected[5, 0] = 1.0, 2.0, 3.0
    np.testing.assert_array_equal(terrain.elevation, expected)


@pytest.mark.parametrize(
    ("cell_height", "expected"), [("max", 4.0), ("mean", 2.0), ("median", 1.0)]
)
def test_several_points_in_a_cell_give_their_highest_mean_or_median(cell_height, expected):
    points = [
        [0.0, 0.0, 1.0],
        [0.01, 0.02, 4.0],
        [-0.02, 0.01, 1.0],
        [0.1, 0.0, 0.0],
        [0.0, 0.1, 0.0],
        [0.1, 0.1, 0.0],
    ]
    terrain = terrain_from_point_cloud(cloud_of(points), 0.1, cell_height)
    assert terrain.elevation[0, 0] == expected
    assert terrain.elevation[1, 1] == 0.0


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 60))
def test_the_median_of_each_cell_is_that_of_its_points(seed, count):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(0.0, 0.5, (count, 2)), rng.normal(size=count)])
    points[:2, :2] = (0.0, 0.0), (0.5, 0.5)
    terrain = terrain_from_point_cloud(cloud_of(points, kind="<f8"), 0.1, "median")
    index = np.rint((points[:, :2] - terrain.origin) / 0.1).astype(int)
    expected = np.full(terrain.elevation.shape, np.nan)
    for column, row in {tuple(pair) for pair in index.tolist()}:
        own = (index == (column, row)).all(axis=1)
        expected[row, column] = np.median(points[own, 2])
    np.testing.assert_array_equal(terrain.elevation, expected)


@pytest.mark.parametrize("shuffled", [False, True])
def test_the_standard_deviation_of_the_heights_comes_back(shuffled):
    plain = rough_terrain()
    std = np.linspace(0.0, 0.25, plain.elevation.size).reshape(plain.elevation.shape)
    terrain = replace(plain, elevation_std=std.astype(np.float32).astype(np.float64))
    cloud = terrain_to_point_cloud(terrain, "map")
    if shuffled:
        points = np.frombuffer(cloud.data, np.uint8).reshape(-1, cloud.point_step)
        order = np.random.default_rng(1).permutation(len(points))
        cloud.data = array.array("B", points[order].tobytes())
    back = terrain_from_point_cloud(cloud)
    known = np.isfinite(plain.elevation)
    np.testing.assert_array_equal(back.elevation_std[known], terrain.elevation_std[known])


def test_the_largest_standard_deviation_of_a_cell_counts():
    points = [(0.0, 0.0, 1.0, 0.01), (0.01, 0.0, 0.5, 0.04), (0.1, 0.0, 1.0, 0.02)]
    points += [(0.0, 0.1, 1.0, 0.03), (0.1, 0.1, 1.0, 0.0)]
    cloud = cloud_of(points, ("x", "y", "z", "elevation_std"))
    terrain = terrain_from_point_cloud(cloud, 0.1)
    np.testing.assert_allclose(terrain.elevation_std, [[0.04, 0.02], [0.03, 0.0]], rtol=1e-6)


def test_a_height_without_its_standard_deviation_is_refused():
    points = [(x, y, 1.0, np.nan if x else 0.1) for x in (0.0, 0.1) for y in (0.0, 0.1)]
    with pytest.raises(TerrainError, match="elevation_std.*where the height is known"):
        terrain_from_point_cloud(cloud_of(points, ("x", "y", "z", "elevation_std")))


def test_the_lowest_friction_of_a_cell_counts():
    points = [
        [0.0, 0.0, 1.0, 0.9],
        [0.01, 0.0, 2.0, 0.4],
        [0.02, 0.0, 1.5, np.nan],
        [0.1, 0.0, 1.0, 0.8],
        [0.0, 0.1, 1.0, np.inf],
        [0.1, 0.1, 1.0, 0.7],
    ]
    terrain = terrain_from_point_cloud(cloud_of(points, ("x", "y", "z", "friction")), 0.1)
    np.testing.assert_allclose(terrain.friction, [[0.4, 0.8], [np.nan, 0.7]], rtol=1e-6)


@pytest.mark.parametrize("quantum", [1e-3, 1e-9])
def test_scattered_points_ask_for_a_resolution(quantum):
    points = np.random.default_rng(5).uniform(0.0, 4.0, (400, 3))
    cloud = cloud_of(np.round(points / quantum) * quantum)
    with pytest.raises(MessageError, match=r"set map_resolution, for these points about 0\.4 m"):
        terrain_from_point_cloud(cloud)
    assert terrain_from_point_cloud(cloud, 0.4).resolution == 0.4


def test_one_stray_point_does_not_take_the_memory():
    points = np.vstack([points_of(rough_terrain()), [1e30, 0.0, 0.0]])
    with pytest.raises(MessageError, match="remove stray points"):
        terrain_from_point_cloud(cloud_of(points), 0.05)


@pytest.mark.parametrize("missing", ["x", "y", "z"])
def test_a_missing_field_is_named(missing):
    names = [name if name != missing else "intensity" for name in ("x", "y", "z")]
    with pytest.raises(MessageError, match=f"no field {missing}; .* has .*intensity"):
        terrain_from_point_cloud(cloud_of(points_of(rough_terrain()), names))


@pytest.mark.parametrize(
    ("datatype", "name"),
    [
        (PointField.INT16, "INT16"),
        (PointField.UINT8, "UINT8"),
        (PointField.INT32, "INT32"),
        (99, "99"),
    ],
)
def test_other_datatypes_are_named(datatype, name):
    cloud = cloud_of(points_of(rough_terrain()))
    cloud.fields[2].datatype = datatype
    with pytest.raises(MessageError, match=f"field z has datatype {name}; it must be FLOAT32"):
        terrain_from_point_cloud(cloud)


def test_zero_points_are_refused():
    for cloud in (PointCloud2(), PointCloud2(height=1, point_step=12)):
        with pytest.raises(MessageError, match="no points"):
            terrain_from_point_cloud(cloud)
    with pytest.raises(MessageError, match="none of the cloud's 4 points"):
        terrain_from_point_cloud(cloud_of(np.full((4, 3), np.nan)))


def test_a_line_of_points_is_no_terrain():
    line = np.column_stack([np.arange(5) * 0.1, np.zeros(5), np.zeros(5)])
    with pytest.raises(TerrainError, match="at least 2 rows"):
        terrain_from_point_cloud(cloud_of(line))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"point_step": 0}, "point_step 0"),
        ({"point_step": 8, "row_step": 8 * 77, "data": bytes(8 * 77)}, "field z at offset 8"),
        ({"row_step": 100}, "row_step 100; 77 points of 12 bytes need at least 924"),
        ({"data": bytes(923)}, "923 bytes of data; height 1 x row_step 924 needs 924"),
        ({"data": bytes(925)}, "925 bytes of data"),
        ({"height": 2}, "924 bytes of data; height 2 x row_step 924 needs 1848"),
        ({"width": 2**31, "height": 2**31}, "row_step 924"),
    ],
)
def test_lengths_that_disagree_are_named(change, text):
    cloud = cloud_of(points_of(rough_terrain()))
    for name, value in change.items():
        setattr(cloud, name, array.array("B", value) if name == "data" else value)
    with pytest.raises(MessageError, match=text):
        terrain_from_point_cloud(cloud)


def test_a_row_step_left_at_zero_is_understood_for_one_row():
    terrain = rough_terrain()
    cloud = cloud_of(points_of(terrain))
    cloud.row_step = 0
    assert_same(terrain_from_point_cloud(cloud), terrain)


def test_a_field_of_several_values_is_refused():
    cloud = cloud_of(points_of(rough_terrain()))
    cloud.fields[0].count = 3
    with pytest.raises(MessageError, match="field x has count 3"):
        read_points(cloud)


@pytest.mark.parametrize("resolution", [-0.1, np.nan, np.inf])
def test_an_impossible_resolution_is_refused(resolution):
    with pytest.raises(MessageError, match="it must be positive, or 0"):
        terrain_from_point_cloud(cloud_of(points_of(rough_terrain())), resolution)


def test_an_unknown_cell_height_is_refused():
    with pytest.raises(MessageError, match="'lowest'; it must be one of"):
        terrain_from_point_cloud(cloud_of(points_of(rough_terrain())), 0.0, "lowest")


def test_the_occupancy_grid_tells_known_from_unknown():
    terrain = rough_terrain()
    grid = terrain_to_occupancy_grid(terrain, "map", Time(sec=3))
    assert (grid.info.height, grid.info.width) == terrain.elevation.shape
    assert grid.info.resolution == pytest.approx(0.05)
    corner = grid.info.origin.position
    assert (corner.x, corner.y) == pytest.approx((-1.225, 3.375))
    cells = np.array(grid.data).reshape(terrain.elevation.shape)
    np.testing.assert_array_equal(cells, np.where(np.isnan(terrain.elevation), -1, 0))
    assert grid.header.frame_id == "map" and grid.info.map_load_time.sec == 3


def test_moved_points_are_those_that_were_moved_before_and_invalid_ones_are_left_out():
    angle, shift = 0.6, np.array([1.0, -2.0, 0.5])
    c, s = np.cos(angle), np.sin(angle)
    move = PointMove(np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), shift)
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (4000, 3))
    points[:, 2] *= 0.05
    here = points @ move.rotation.T + shift
    seen = np.vstack([points, [[np.nan, 0.0, 0.0], [0.0, 0.0, np.inf], [0.0, np.nan, np.nan]]])
    found = terrain_from_point_cloud(cloud_of(seen, kind="<f8"), 0.1, "max", move)
    right = terrain_from_point_cloud(cloud_of(here, kind="<f8"), 0.1, "max")
    assert_same(found, right)
    with pytest.raises(MessageError, match="set map_resolution"):
        terrain_from_point_cloud(cloud_of(seen, kind="<f8"), move=move)
    with pytest.raises(MessageError, match="has finite x, y and z"):
        terrain_from_point_cloud(cloud_of(np.full((4, 3), np.nan)), 0.1, move=move)
