# SPDX-License-Identifier: Apache-2.0
"""Every cloud becomes a terrain cell by cell, or is refused by name in bounded memory."""

import array
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from msg_adapters.elevation import terrain_from_point_cloud, terrain_to_point_cloud
from msg_adapters.errors import MAX_TEXT, MessageError
from msg_adapters.gridding import detect_raster
from msg_adapters.results.grids import terrain_to_occupancy_grid
from rover_physics import Terrain
from rover_physics.errors import TerrainError

pytestmark = pytest.mark.filterwarnings("error")  # no warning of NumPy, whatever the points
XYZ = ("x", "y", "z")
KINDS = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
"""Types of fields, in the order of their numbers from 1 on."""


def rough_terrain(resolution=0.05, origin=(-1.2, 3.4)):
    """Return a terrain of float32 heights with gaps, one of them at the edge."""
    heights = np.random.default_rng(1).normal(0.0, 0.3, (7, 11))
    elevation = heights.astype(np.float32).astype(np.float64)
    elevation[2, 3] = elevation[0, 5] = np.nan
    return Terrain(elevation, resolution, origin)


def cloud_of(points, names=XYZ, kind="<f8", gap=0, height=1, row_padding=0):
    """Lay out points (n, k) as a cloud with `gap` bytes before each field and padded rows."""
    size, count = np.dtype(kind).itemsize, len(names)
    offsets = [gap + i * (size + gap) for i in range(count)]
    layout = {"names": names, "formats": [kind] * count, "offsets": offsets}
    laid = np.zeros(len(points), np.dtype(layout | {"itemsize": count * (size + gap) + gap}))
    for name, values in zip(names, np.transpose(points), strict=True):
        laid[name] = values
    return cloud_from(laid, height, row_padding)


def cloud_from(laid, height=1, row_padding=0):
    """Return a cloud of points, records that have a field x, with padded rows."""
    raw = np.pad(laid.view(np.uint8).reshape(height, -1), ((0, 0), (0, row_padding)))
    cloud = PointCloud2(height=height, width=len(laid) // height, point_step=laid.itemsize)
    cloud.row_step, cloud.is_bigendian = raw.shape[1], laid.dtype["x"].str[0] == ">"
    cloud.fields = [
        PointField(name=name, offset=offset, count=1, datatype=1 + KINDS.index(kind.str[1:]))
        for name, (kind, offset) in laid.dtype.fields.items()
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


def grid(spacing=0.1, n=8, origin=(0.0, 0.0)):
    """Return points (n * n, 3) of a level grid, row by row."""
    return points_of(Terrain(np.zeros((n, n)), spacing, origin))


def assert_same(terrain, expected):
    np.testing.assert_array_equal(terrain.elevation, expected.elevation)
    assert terrain.resolution == expected.resolution
    assert terrain.origin == expected.origin


def refusal_of(cloud, resolution=0.0, **options):
    """Return the text of the refusal of a cloud."""
    with pytest.raises((MessageError, TerrainError)) as raised:
        terrain_from_point_cloud(cloud, resolution, **options)
    assert len(str(raised.value)) <= MAX_TEXT
    return str(raised.value)


@pytest.mark.parametrize("shuffled", [False, True])
def test_a_terrain_comes_back_as_it_was_with_all_its_layers(shuffled):
    plain = rough_terrain()
    layer = np.linspace(0.0, 0.25, 77).astype(np.float32).astype(float).reshape(7, 11)
    classes = np.floor(20.0 * layer)
    terrain = replace(plain, elevation_std=layer, friction=0.5 + layer, ground_class=classes)
    cloud = terrain_to_point_cloud(terrain, "map")
    if shuffled:
        points = np.frombuffer(cloud.data, np.uint8).reshape(-1, cloud.point_step)
        cloud.data = array.array("B", np.random.default_rng(1).permutation(points).tobytes())
    back = terrain_from_point_cloud(cloud)
    assert_same(back, terrain)
    known = np.isfinite(plain.elevation)
    np.testing.assert_array_equal(back.elevation_std[known], layer[known])
    np.testing.assert_allclose(back.friction[known], 0.5 + layer[known], rtol=1e-7)
    np.testing.assert_array_equal(back.ground_class[known], classes[known])


@given(
    rows=st.integers(2, 40),
    columns=st.integers(2, 40),
    millimetres=st.integers(5, 1000),
    corner=st.tuples(st.integers(-90_000, 90_000), st.integers(-90_000, 90_000)),
)
def test_any_grid_in_millimetres_comes_back_as_it_was(rows, columns, millimetres, corner):
    elevation = np.arange(rows * columns, dtype=np.float64).reshape(rows, columns)
    terrain = Terrain(elevation, millimetres / 1000, (corner[0] / 1000, corner[1] / 1000))
    assert_same(terrain_from_point_cloud(terrain_to_point_cloud(terrain, "map")), terrain)


@pytest.mark.parametrize(("x_step", "y_step"), [(1, 1), (1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize(
    ("kind", "gap", "height", "row_padding"),
    [("<f4", 0, 1, 0), (">f4", 3, 7, 9), ("<f8", 3, 1, 5), (">f8", 0, 7, 0)],
)
def test_layout_order_of_fields_and_way_of_the_rows_do_not_change_the_terrain(
    kind, gap, height, row_padding, x_step, y_step
):
    terrain = rough_terrain()
    rows = points_of(terrain).reshape(7, 11, 3)[::y_step, ::x_step]
    for points, count in ((rows, height), (rows.transpose(1, 0, 2), 1)):
        x, y, z = np.moveaxis(points, 2, 0)
        assert detect_raster(x, y) is not None
        mixed = np.column_stack([one.ravel() for one in (z, np.ones_like(z), y, x)])
        cloud = cloud_of(mixed, ("z", "intensity", "y", "x"), kind, gap, count, row_padding)
        if row_padding == 0 and count == 1:
            cloud.row_step = 0  # not set: understood for one row
        assert_same(terrain_from_point_cloud(cloud), terrain)


def test_missing_and_infinite_points_are_unknown_ground():
    terrain = rough_terrain()
    points = points_of(terrain)
    unknown = np.isnan(points[:, 2])
    infinite, unplaced = points.copy(), points.copy()
    infinite[unknown, 2], unplaced[unknown] = np.inf, np.nan
    nowhere = np.vstack([points, [[np.inf, 0.0, 0.0], [0.0, -np.inf, 0.0], [np.nan, 0.0, 0.0]]])
    for given_points in (points[~unknown], infinite, unplaced, nowhere):
        assert_same(terrain_from_point_cloud(cloud_of(given_points)), terrain)
    column = np.abs(points[:, 0] - (terrain.origin[0] + 4 * terrain.resolution)) < 1e-6
    back = terrain_from_point_cloud(cloud_of(points[~column]))
    assert back.elevation.shape == (7, 11) and np.isnan(back.elevation[:, 4]).all()


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
    in_one = [[0.0, 0.0, 1.0], [0.01, 0.02, 4.0], [-0.02, 0.01, 1.0]]
    points = [*in_one, [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.1, 0.0]]
    terrain = terrain_from_point_cloud(cloud_of(points), 0.1, cell_height)
    assert terrain.elevation[0, 0] == expected and terrain.elevation[1, 1] == 0.0


def test_the_lowest_friction_the_largest_deviation_and_the_class_of_most_points_count():
    points = [
        [0.0, 0.0, 1.0, 0.9, 0.01, 1.0],
        [0.01, 0.0, 2.0, 0.4, 0.04, 2.0],
        [0.02, 0.0, 1.5, np.nan, 0.0, 7.0],
        [0.03, 0.0, 1.5, 0.5, 0.0, 7.0],
        [0.1, 0.0, 1.0, 0.8, 0.02, np.nan],
        [0.11, 0.0, 1.0, 0.8, 0.02, -1.0],
        [0.12, 0.0, 1.0, 0.8, 0.02, 4.0],
        [0.0, 0.1, 1.0, np.inf, 0.03, np.nan],
        [0.1, 0.1, 1.0, 0.7, 0.0, 0.0],
    ]
    names = (*XYZ, "friction", "elevation_std", "class")
    terrain = terrain_from_point_cloud(cloud_of(points, names), 0.1)
    np.testing.assert_allclose(terrain.friction, [[0.4, 0.8], [np.nan, 0.7]])
    np.testing.assert_allclose(terrain.elevation_std, [[0.04, 0.02], [0.03, 0.0]])
    np.testing.assert_array_equal(terrain.ground_class, [[7.0, 4.0], [np.nan, 0.0]])


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_classes_of_any_datatype_are_read_and_negative_ones_are_none(kind, shuffled):
    numbers = np.array([[3, 0, 100], [1, 3, 2]])
    x, y = np.meshgrid(np.arange(3.0), np.arange(2.0))
    points = np.zeros(6, [("x", "f4"), ("y", "f4"), ("class", kind), ("z", "f4")])
    points["x"], points["y"], points["class"] = x.ravel(), y.ravel(), numbers.ravel()
    right = numbers.astype(float)
    if kind[0] != "u":
        points["class"][3], right[1, 0] = -1, np.nan
    if shuffled:
        points = np.random.default_rng(1).permutation(points)
    np.testing.assert_array_equal(terrain_from_point_cloud(cloud_from(points)).ground_class, right)


@pytest.mark.parametrize("quantum", [1e-3, 1e-9])
def test_scattered_points_ask_for_a_resolution(quantum):
    points = np.random.default_rng(5).uniform(0.0, 4.0, (400, 3))
    cloud = cloud_of(np.round(points / quantum) * quantum)
    assert "set map_resolution, for these points about 0.4 m" in refusal_of(cloud)
    assert terrain_from_point_cloud(cloud, 0.4).resolution == 0.4


def test_moved_points_are_those_that_were_moved_before_and_invalid_ones_are_left_out():
    c, s = np.cos(0.6), np.sin(0.6)
    move = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), np.ones(3)
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (4000, 3)) * [1.0, 1.0, 0.05]
    here = points @ move[0].T + 1.0
    seen = np.vstack([points, [[np.nan, 0.0, 0.0], [0.0, 0.0, np.inf], [0.0, np.nan, np.nan]]])
    found = terrain_from_point_cloud(cloud_of(seen), 0.1, "max", move)
    assert_same(found, terrain_from_point_cloud(cloud_of(here), 0.1, "max"))
    assert "set map_resolution" in refusal_of(cloud_of(seen), move=move)


def test_the_occupancy_grid_tells_known_from_unknown():
    terrain = rough_terrain()
    occupancy = terrain_to_occupancy_grid(terrain, Header(frame_id="map", stamp=Time(sec=3)))
    info = occupancy.info
    assert (info.height, info.width) == terrain.elevation.shape
    assert (info.origin.position.x, info.origin.position.y) == pytest.approx((-1.225, 3.375))
    cells = np.array(occupancy.data).reshape(terrain.elevation.shape)
    np.testing.assert_array_equal(cells, np.where(np.isnan(terrain.elevation), -1, 0))
    assert occupancy.header.frame_id == "map" and info.map_load_time.sec == 3


# What is refused


def changed(field=None, **changes):
    """Return a cloud of 77 points in float32 of which the message or its z is changed."""
    cloud = cloud_of(points_of(rough_terrain()), kind="<f4")
    for name, value in changes.items():
        part = cloud if field is None else cloud.fields[field]
        setattr(part, name, array.array("B", value) if name == "data" else value)
    return cloud


def far(value, column):
    points = grid()
    points[9, column] = value
    return cloud_of(points)


LINE = np.column_stack([np.arange(5) * 0.1, np.zeros(5), np.zeros(5)])
STD_MISSING = [(x, y, 1.0, np.nan if x else 0.1) for x in (0.0, 0.1) for y in (0.0, 0.1)]
NO_FRICTION = np.column_stack([grid(), np.full(64, -0.1)])
REFUSED = [
    (PointCloud2(), "no points"),
    (cloud_of(np.full((4, 3), np.nan)), "none of the cloud's 4 points"),
    (cloud_of(LINE), "at least 2 rows"),
    (changed(2, name="n" * 1_000_000), "no field z; "),
    (changed(2, datatype=PointField.INT16), "field z has datatype INT16; it must be FLOAT32"),
    (changed(0, count=3), "field x has count 3"),
    (changed(2, name="x"), "two fields x"),
    (changed(point_step=0), "point_step 0"),
    (changed(point_step=2**32 - 1), "point_step"),
    (changed(point_step=8, row_step=616, data=bytes(616)), "field z at offset 8"),
    (changed(row_step=100), "row_step 100; 77 points of 12 bytes need at least 924"),
    (changed(data=bytes(923)), "923 bytes of data; height 1 x row_step 924 needs 924"),
    (changed(width=2**31, height=2**31), "row_step 924"),
    (far(1e30, 0), "within 1e+09 m: remove stray points"),
    (cloud_of(grid() * [1e155, 1e155, 1.0]), "within 1e+09 m: remove stray points"),
    (far(1.1e9, 2), "elevation[1, 1] is"),
    (cloud_of(grid() * 1e-8), "map_resolution"),
    (cloud_of(NO_FRICTION, (*XYZ, "friction")), "friction[0, 0] is -0.1"),
    (cloud_of(STD_MISSING, (*XYZ, "elevation_std")), "where the height is known"),
]


@pytest.mark.parametrize(("cloud", "text"), REFUSED, ids=[text[:40] for _, text in REFUSED])
def test_a_bad_cloud_is_refused_by_name(cloud, text):
    assert text in refusal_of(cloud)


@pytest.mark.parametrize("resolution", [1e-9, 1e7, np.nan, -1.0])
def test_a_resolution_out_of_range_is_refused_with_the_range(resolution):
    assert "or 0 to detect it, and from 1e-05 to 1e+06" in refusal_of(cloud_of(grid()), resolution)


def test_a_few_points_do_not_take_the_memory_of_a_huge_map():
    ends = [[0.0, 0.0, 0.0], [0.0, 3e4, 0.0], [3e4, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    tracemalloc.start()
    try:
        for resolution in (0.0, 0.1, 1e-5):
            refusal_of(cloud_of(ends), resolution)
        assert tracemalloc.get_traced_memory()[1] < 2e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("spacing", [0.05, 0.5])
@pytest.mark.parametrize("resolution", [0.0, 0.05])
@pytest.mark.parametrize("shuffled", [False, True])
def test_float32_points_in_utm_get_the_advice_to_shift_the_origin(spacing, resolution, shuffled):
    points = grid(spacing, 40, (448_000.0, 4_603_000.0))
    points = np.random.default_rng(1).permutation(points) if shuffled else points
    text = refusal_of(cloud_of(points, kind="<f4"), resolution)
    assert "rounded to" in text and "shift the origin" in text and "FLOAT64" in text
    assert "map_resolution" not in text
    exact = terrain_from_point_cloud(cloud_of(points), resolution)
    if resolution in (0.0, spacing):
        assert exact.elevation.shape == (40, 40)


@given(
    halves=st.lists(st.tuples(st.integers(-60, 60), st.integers(-60, 60)), min_size=2, max_size=9),
    resolution=st.sampled_from((0.1, 0.3, 8.0, 1e-3)),
    origin=st.sampled_from((0.0, 4_603_000.0, -0.7)),
)
def test_points_half_way_between_cells_stay_on_the_map(halves, resolution, origin):
    points = np.column_stack([0.5 * resolution * np.array(halves) + origin, np.ones(len(halves))])
    try:
        terrain = terrain_from_point_cloud(cloud_of(points), resolution)
    except TerrainError as error:
        assert "at least 2 rows" in str(error)
        return
    assert np.nanmax(terrain.elevation) == 1.0
    xmin, xmax, ymin, ymax = terrain.bounds
    half = 0.5000001 * resolution
    assert (np.abs(points[:, 0] - np.clip(points[:, 0], xmin, xmax)) <= half).all()
    assert (np.abs(points[:, 1] - np.clip(points[:, 1], ymin, ymax)) <= half).all()


@given(
    rows=st.lists(st.tuples(*[st.floats(width=32)] * 3), min_size=1, max_size=12),
    resolution=st.sampled_from((0.0, 0.05, 1e-3, 1e5)),
    kind=st.sampled_from(("<f4", "<f8")),
)
def test_every_set_of_points_becomes_a_terrain_or_a_refusal(rows, resolution, kind):
    try:
        assert terrain_from_point_cloud(cloud_of(rows, kind=kind), resolution)
    except (MessageError, TerrainError) as error:
        assert len(str(error)) <= MAX_TEXT
