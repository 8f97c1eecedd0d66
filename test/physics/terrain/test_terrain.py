# SPDX-License-Identifier: Apache-2.0
"""The terrain: what is refused, the bilinear look-up, filled gaps, files, and how it is packed."""

import gc
import pickle
import weakref
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from rover_physics import Terrain, load_terrain, save_terrain
from rover_physics.errors import TerrainError
from rover_physics.terrain.ground import BLOCK, friction_at, height_inside, pack_ground
from rover_physics.terrain.terrain_file import terrain_presets
from support.grounds import plane, raised


@given(
    st.integers(0, 1000),
    st.floats(0.01, 3.0),
    st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), min_size=1, max_size=20),
)
def test_rows_go_along_y_columns_along_x_and_the_look_up_between_is_bilinear(
    seed, resolution, origin, places
):
    heights = np.random.default_rng(seed).normal(size=(5, 7))
    terrain = Terrain(heights, resolution, origin)
    xs, ys = (start + resolution * np.arange(n) for start, n in zip(origin, (7, 5), strict=True))
    assert terrain.bounds == (xs[0], xs[-1], ys[0], ys[-1])
    u, v = np.array(places).T
    x, y = xs[0] + u * (xs[-1] - xs[0]), ys[0] + v * (ys[-1] - ys[0])
    assert terrain.contains(x, y).all()
    expected = RegularGridInterpolator((ys, xs), heights, bounds_error=False, fill_value=None)
    np.testing.assert_allclose(terrain.elevation_at(x, y), expected((y, x)), rtol=0.0, atol=1e-9)


def test_look_up_is_unknown_off_the_map_and_where_a_corner_is_unknown():
    terrain = Terrain(plane(-0.2, 0.3).elevation[:40], 0.04, (-1.2, -1.2))
    xmin, xmax, ymin, ymax = terrain.bounds
    x = [xmin - 0.01, xmax + 0.01, 0.0, 0.0, np.nan]
    y = [0.0, 0.0, ymin - 0.01, ymax + 0.01, 0.0]
    assert np.isnan(terrain.elevation_at(x, y)).all()
    assert not terrain.contains(x, y).any()
    terrain = raised(Terrain(terrain.elevation, 0.5, (-1.0, 2.0)), (2, 3), np.nan)
    x, y, near = -1.0 + 0.5 * 3, 2.0 + 0.5 * 2, np.array([-0.2, 0.2])
    around = terrain.elevation_at(x + near[:, None], y + near)
    assert around.shape == (2, 2) and np.isnan(around).all()
    assert np.isfinite(terrain.elevation_at(x - 0.6, y))
    assert terrain.contains(x, y) and terrain.elevation_at(0.0, 3.0).shape == ()


FLAT = np.zeros((4, 5))
SOIL = np.full((4, 5), -1)
NAMES = ("dry_sand", "slab")


def same(value: float) -> np.ndarray:
    return np.full((4, 5), value)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        *[("resolution", v, "resolution is .*; it must be one number above 0 in m")
          for v in (0.0, np.nan, "0.1", [0.1, 0.1])],
        *[("origin", v, "origin is .*; it must be two numbers in m")
          for v in ((0.0,), (0.0, np.nan), "ab")],
        ("elevation", np.zeros(5), r"elevation has shape \(5,\)"),
        ("elevation", np.zeros((1, 5)), "at least 2 rows and 2 columns"),
        ("elevation", np.full((3, 4), np.nan), "all 3 x 4 are NaN"),
        ("elevation", np.array([[0.0, 1.0], [np.inf, 0.0]]), r"elevation\[1, 0\] is inf"),
        ("friction", np.ones((5, 4)), r"shape \(5, 4\); it must be that of elevation, \(4, 5\)"),
        ("friction", same(0.0), r"friction\[0, 0\] is 0.0; it must be above 0"),
        ("elevation_std", same(-0.01), r"elevation_std\[0, 0\] is -0.01; it must be at least 0"),
        ("elevation_std", same(np.nan), r"\[0, 0\] is nan; .* where the height is known"),
        *[("ground_class", same(v), r"ground_class\[0, 0\] is .* must be")
          for v in (2.5, -1.0, 1e6)],
        ("soil", SOIL + 3, r"soil\[0, 0\] is 2; it must be -1 for the default, or 0 to 1"),
        ("soil", FLAT, "soil has type float64; it must be an array of whole numbers"),
        ("soil", None, "soil_names are dry_sand, slab without a soil layer"),
        ("soil_names", (), r"soil\[0, 0\] is 0; .* as there are no soil_names"),
        ("soil_names", "dry_sand", "soil_names is dry_sand; it must be a list of different names"),
        ("soil_names", ("a", "b", "a"), "soil_names has 'a' twice"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_refused_by_its_name(name, value, text):
    right = {"elevation": FLAT, "resolution": 0.1, "origin": (0.0, 0.0)}
    if name.startswith("soil"):
        right |= {"soil": SOIL + 1, "soil_names": NAMES}
    with pytest.raises(TerrainError, match=text):
        Terrain(**right | {name: value})


def test_a_filled_gap_is_as_uncertain_as_the_worst_of_its_rim():
    gapped = raised(with_gap()[1], ([2, 3], [2, 3]), np.nan)
    std = np.where(np.isnan(gapped.elevation), np.nan, 0.01)
    std[7, 10], std[2, 3], std[15, 15] = 0.05, 0.03, 0.9
    filled = replace(gapped, elevation_std=std).fill_gaps(0.3).elevation_std
    assert filled is not None
    assert (filled[8:11, 9:14] == 0.05).all()
    assert (filled[2, 2], filled[3, 3]) == (0.03, 0.03)
    known = np.isfinite(gapped.elevation)
    assert np.array_equal(filled[known], std[known])


def with_gap(rows=slice(8, 11), columns=slice(9, 14)):
    whole = Terrain(plane(-0.2, 0.3).elevation, 0.1)
    return whole, raised(whole, (rows, columns), np.nan)


def test_a_gap_in_a_plane_is_filled_exactly_if_its_shorter_side_is_no_wider_but_at_no_edge():
    whole, gapped = with_gap()
    assert np.isnan(gapped.fill_gaps(0.29).elevation).sum() == 15
    with pytest.raises(TerrainError, match="max_gap is"):
        gapped.fill_gaps(-0.1)
    assert np.allclose(gapped.fill_gaps(0.3).elevation, whole.elevation, rtol=0.0, atol=1e-12)
    first, last, five = slice(0, 2), slice(59, 61), slice(5, 6)
    for rows, columns in ((first, five), (last, five), (five, first), (five, last)):
        _, gapped = with_gap(rows=rows, columns=columns)
        assert np.isnan(gapped.fill_gaps(5.0).elevation).sum() == 2


def test_a_saved_terrain_is_loaded_as_it_was(tmp_path):
    rng = np.random.default_rng(2)
    heights = rng.normal(size=(4, 5))
    heights[1, 2] = np.nan
    layers = {
        "friction": np.where(np.isnan(heights), np.nan, 0.7),
        "soil": rng.integers(-1, 2, (4, 5)),
        "elevation_std": rng.uniform(0.0, 0.1, (4, 5)),
        "ground_class": np.where(np.arange(5) < 2, 3.0, np.nan) + np.zeros((4, 1)),
    }
    for some in ({}, layers):
        terrain = Terrain(heights, 0.25, (3.0, -4.0), soil_names=NAMES if some else (), **some)
        save_terrain(tmp_path / "a.npz", terrain, source="made up")
        loaded = load_terrain(tmp_path / "a.npz")
        for one in fields(Terrain):
            found, saved = getattr(loaded, one.name), getattr(terrain, one.name)
            np.testing.assert_array_equal(found, saved, one.name)


ENTRIES = {"elevation": FLAT, "resolution": 0.1, "origin": [0.0, 0.0]}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        *[({name: None}, f"no entry {name};") for name in ENTRIES],
        ({"resolution": -1.0}, r"resolution is -1\.0"),
        ({"elevation": np.empty((2, 2), object)}, "entry elevation is damaged .Object arrays"),
        ({"elevation": np.zeros((12, 12))}, "entry elevation has 144 values; the limit is 120"),
    ],
)
def test_a_file_with_a_wrong_entry_is_refused_by_its_name(tmp_path, changes, text):
    entries = {k: v for k, v in (ENTRIES | changes).items() if v is not None}
    np.savez(tmp_path / "map.npz", **entries)
    with pytest.raises(TerrainError, match=rf"map\.npz: {text}"):
        load_terrain(tmp_path / "map.npz", max_cells=120)


def test_an_unreadable_or_unwritable_file_is_refused(tmp_path):
    np.save(tmp_path / "single.npy", FLAT)
    with pytest.raises(TerrainError, match=r"single.npy: .*\.npz"):
        load_terrain(tmp_path / "single.npy")
    with pytest.raises(TerrainError, match="cannot be written: No such file"):
        save_terrain(tmp_path / "none" / "map.npz", plane(0.0, 0.0))


def test_a_preset_is_found_by_its_name_from_any_folder_and_keeps_its_licence(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    terrain = load_terrain("spirit")
    assert terrain.elevation.shape == (400, 434)
    for name, path in terrain_presets().items():
        with np.load(path, allow_pickle=False) as entries:
            assert "NASA/JPL" in str(entries["licence"]), name
            assert str(entries["source"])
    with pytest.raises(TerrainError, match="no terrain 'opportunity': .* presets are spirit"):
        load_terrain("opportunity")
    with pytest.raises(TerrainError, match="no terrain 'spirit'"):
        load_terrain(Path("spirit"))  # a path is a file, whatever the presets are called


@pytest.mark.parametrize("shape", [(8, 12), (2, 3), (41, 30)])
def test_blocks_hold_the_highest_ground(shape):
    rng = np.random.default_rng(5)
    elevation = rng.normal(size=shape)
    elevation[rng.random(shape) < 0.2] = np.nan
    elevation[0, 0], elevation[-1, -1] = 0.3, np.nan
    packed = pack_ground(Terrain(elevation, 0.1))
    for name, of_unknown in (("block_max", np.inf), ("known_block_max", -np.inf)):
        heights = np.where(np.isnan(elevation), of_unknown, elevation)
        expected = [
            [heights[i : i + BLOCK, j : j + BLOCK].max() for j in range(0, shape[1], BLOCK)]
            for i in range(0, shape[0], BLOCK)
        ]
        np.testing.assert_array_equal(packed.arrays[name], expected)


def test_an_edit_of_the_array_that_was_given_does_not_reach_the_ground():
    """A table of block maxima that is older than the heights would hide obstacles."""
    heights = np.zeros((9, 9))
    view = heights[:]
    view.flags.writeable = False  # its owner still writes
    for given_array in (heights, view):
        heights[4, 4] = 0.0
        terrain = Terrain(given_array, 0.1)
        packed = pack_ground(terrain)
        heights[4, 4] = 5.0
        assert terrain.elevation[4, 4] == packed.arrays["elevation"][4, 4] == 0.0
    assert Terrain(terrain.elevation, 0.1).elevation is terrain.elevation  # nothing to protect
    with pytest.raises(ValueError, match="read-only"):
        terrain.elevation[4, 4] = 5.0


def test_a_ground_outlives_its_terrain():
    """The record holds addresses: whoever has the Ground has the arrays."""
    terrain = Terrain(np.full((40, 40), 0.25), 0.1, friction=np.full((40, 40), 0.6))
    watched = weakref.ref(terrain)
    ground = pack_ground.__wrapped__(terrain)
    del terrain
    gc.collect()
    assert watched() is None
    _ = [np.full((40, 40), -1.0) for _ in range(50)]  # would take the place of what is freed
    assert height_inside(ground.records[0], 10.3, 20.7) == 0.25
    assert friction_at(ground.records[0], 1.0, 2.0, 0.9) == 0.6
    with pytest.raises(TypeError, match="pickle its Terrain"):
        pickle.dumps(ground)
