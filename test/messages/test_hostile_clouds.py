"""Every cloud becomes a terrain or is refused by name, in bounded time and memory."""

import array
import time
import tracemalloc
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import PointCloud2, PointField

from benchmarks.fuzz.hostile import HostileMaker
from msg_adapters.elevation import terrain_from_point_cloud, terrain_to_point_cloud
from msg_adapters.errors import MAX_TEXT, MessageError
from rover_physics.errors import TerrainError
from rover_physics.terrain.grid import Terrain

FLOAT32, FLOAT64 = PointField.FLOAT32, PointField.FLOAT64


def cloud_of(points, datatype=FLOAT64, names=("x", "y", "z")):
    """Return a cloud of points (n, k) in one row."""
    kind = np.dtype("<f4" if datatype == FLOAT32 else "<f8")
    values = np.ascontiguousarray(points, kind)
    step = kind.itemsize * len(names)
    cloud = PointCloud2(height=1, width=len(values), point_step=step, row_step=step * len(values))
    cloud.header.frame_id = "map"
    cloud.fields = [
        PointField(name=name, offset=i * kind.itemsize, datatype=datatype, count=1)
        for i, name in enumerate(names)
    ]
    cloud.data = array.array("B", values.tobytes())
    return cloud


def grid(spacing=0.1, n=8, origin=(0.0, 0.0)):
    """Return points (n * n, 3) of a level grid, row by row."""
    axis = spacing * np.arange(n)
    x, y = np.meshgrid(axis + origin[0], axis + origin[1])
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])


def refusal_of(cloud, resolution=0.0):
    """Return the text of the refusal of a cloud, without any warning of NumPy."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises((MessageError, TerrainError)) as raised:
            terrain_from_point_cloud(cloud, resolution)
    return str(raised.value)


@pytest.mark.parametrize("resolution", [0.0, 0.1])
@pytest.mark.parametrize("shuffled", [False, True])
def test_points_at_infinity_are_ignored_like_those_at_nan(resolution, shuffled):
    points = np.vstack([grid(), [[np.inf, 0.0, 0.0], [0.0, -np.inf, 0.0], [np.nan, 0.0, 0.0]]])
    points = np.random.default_rng(1).permutation(points) if shuffled else points
    terrain = terrain_from_point_cloud(cloud_of(points), resolution)
    assert terrain.elevation.shape == (8, 8) and (terrain.elevation == 0.0).all()


@pytest.mark.parametrize("column", [0, 1])
def test_a_whole_line_of_a_raster_at_infinity_is_no_line_of_the_map(column):
    points = grid()
    points[points[:, column] == points[-1, column], column] = np.inf
    terrain = terrain_from_point_cloud(cloud_of(points), 0.1)
    assert sorted(terrain.elevation.shape) == [7, 8]


@pytest.mark.parametrize("spacing", [1e-6, 1e-7, 1e-9, 1e-150, 1e-300, 5e-324])
@pytest.mark.parametrize("datatype", [FLOAT32, FLOAT64])
def test_points_closer_than_any_map_are_refused(spacing, datatype):
    text = refusal_of(cloud_of(grid(spacing), datatype))
    assert any(word in text for word in ("map_resolution", "rounded", "2 rows")), text


@pytest.mark.parametrize("far", [1e10, 1e19, 1e30, 1e154, 1e155, 1e200, 1.7e308])
@pytest.mark.parametrize("resolution", [0.0, 0.1])
@pytest.mark.parametrize("everywhere", [False, True])
def test_coordinates_beyond_any_map_are_refused_by_name(far, resolution, everywhere):
    points = grid()
    if everywhere:
        points[:, :2] *= far
    else:
        points[5, 0] = far
    text = refusal_of(cloud_of(points), resolution)
    assert "within 1e+09 m: remove stray points" in text


@pytest.mark.parametrize("far", [1.1e9, 1e30, 1e154, 1e300])
def test_heights_beyond_any_map_are_refused_by_name(far):
    points = grid()
    points[9, 2] = far
    assert "elevation[1, 1] is" in refusal_of(cloud_of(points))


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("friction", -0.1, "friction[0, 0] is -0.1"),
        ("friction", 1e300, "friction[0, 0] is 1e+300"),
        ("friction", 5e-324, "friction[0, 0] is 5e-324"),
        ("elevation_std", -0.1, "elevation_std[0, 0] is -0.1"),
        ("elevation_std", np.inf, "elevation_std[0, 0] is inf"),
        ("elevation_std", 1e200, "elevation_std[0, 0] is 1e+200"),
    ],
)
def test_an_impossible_value_of_a_layer_is_named(name, value, text):
    points = np.column_stack([grid(), np.full(64, value)])
    assert text in refusal_of(cloud_of(points, names=("x", "y", "z", name)))


def test_a_few_points_do_not_take_the_memory_of_a_huge_map():
    ends = [[0.0, 0.0, 0.0], [0.0, 3e4, 0.0], [3e4, 0.0, 0.0]]
    line = np.column_stack([np.arange(1500.0), np.zeros(1500), np.zeros(1500)])
    tracemalloc.start()
    try:
        for resolution in (0.0, 0.1, 1e-5):
            refusal_of(cloud_of([*ends, *line[:3]]), resolution)
        assert tracemalloc.get_traced_memory()[1] < 2e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("resolution", "right"), [(1e-9, "1e-05"), (1e7, "1e+06"), (np.nan, "1e-05"), (-1.0, "1e-05")]
)
def test_a_resolution_out_of_range_says_what_would_be_right(resolution, right):
    assert right in refusal_of(cloud_of(grid()), resolution)


def test_a_field_that_comes_twice_is_refused():
    for name in ("x", "z"):
        cloud = cloud_of(grid())
        cloud.fields = [*cloud.fields, PointField(name=name, datatype=FLOAT64, count=1)]
        assert f"two fields {name}" in refusal_of(cloud)


def test_an_endless_name_does_not_make_an_endless_error():
    cloud = cloud_of(grid())
    cloud.fields[0].name = "n" * 1_000_000
    assert len(refusal_of(cloud)) <= MAX_TEXT


@pytest.mark.parametrize("step", [2**31, 2**32 - 1])
def test_a_point_step_of_gigabytes_is_refused(step):
    cloud = cloud_of(grid())
    cloud.point_step = step
    assert "point_step" in refusal_of(cloud)


@pytest.mark.parametrize("spacing", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("resolution", [0.0, 0.05])
@pytest.mark.parametrize("shuffled", [False, True])
def test_float32_points_in_utm_get_the_advice_to_shift_the_origin(spacing, resolution, shuffled):
    points = grid(spacing, 40, (448_000.0, 4_603_000.0))
    points = np.random.default_rng(1).permutation(points) if shuffled else points
    text = refusal_of(cloud_of(points, FLOAT32), resolution)
    assert "rounded to" in text and "shift the origin" in text and "FLOAT64" in text
    assert "map_resolution" not in text
    exact = terrain_from_point_cloud(cloud_of(points, FLOAT64), resolution)
    if resolution in (0.0, spacing):
        assert exact.elevation.shape == (40, 40)


def test_float32_points_in_utm_with_coarse_cells_are_taken():
    points = grid(4.0, 20, (448_000.0, 4_603_000.0))
    assert terrain_from_point_cloud(cloud_of(points, FLOAT32)).elevation.shape == (20, 20)
    assert terrain_from_point_cloud(cloud_of(points, FLOAT32), 8.0).resolution == 8.0


@settings(max_examples=200, deadline=None)
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


def take_or_refuse(cloud, resolution):
    """Take a cloud; any other error than those of the input, a warning or a delay fails."""
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            terrain = terrain_from_point_cloud(cloud, resolution)
            assert isinstance(terrain, Terrain)
        except (MessageError, TerrainError) as error:
            assert "\n" not in str(error).strip() or len(str(error)) <= MAX_TEXT
    assert time.perf_counter() - began < 60.0


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), resolution=st.sampled_from((0.0, 0.05, 1e-3, 10.0)))
def test_every_hostile_cloud_becomes_a_terrain_or_a_refusal(seed, resolution):
    take_or_refuse(HostileMaker(seed).make("cloud"), resolution)


@settings(max_examples=200, deadline=None)
@given(
    rows=st.lists(
        st.tuples(st.floats(width=32), st.floats(width=32), st.floats(width=32)),
        min_size=1,
        max_size=12,
    ),
    resolution=st.sampled_from((0.0, 0.05, 1e5)),
)
def test_every_set_of_points_becomes_a_terrain_or_a_refusal(rows, resolution):
    take_or_refuse(cloud_of(np.array(rows), FLOAT32), resolution)
    take_or_refuse(cloud_of(np.array(rows), FLOAT64), resolution)


@settings(max_examples=100, deadline=None)
@given(data=st.binary(min_size=0, max_size=600), step=st.integers(0, 40))
def test_any_bytes_become_a_terrain_or_a_refusal(data, step):
    cloud = terrain_to_point_cloud(Terrain(np.zeros((3, 3)), 0.1), "map")
    cloud.data = array.array("B", data)
    cloud.point_step, cloud.height = step, 1
    cloud.width = len(data) // step if step else len(data)
    cloud.row_step = len(data)
    take_or_refuse(cloud, 0.1)
