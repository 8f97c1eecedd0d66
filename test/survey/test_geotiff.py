# SPDX-License-Identifier: Apache-2.0
"""GeoTIFF maps keep their georeference and holes; those of another kind are refused."""

import shutil
import tracemalloc

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")

from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.cog import write_cog, write_layers
from rover_planner.survey.map_source import GeoTiffMap, MapFrame
from rover_planner.survey.survey import prepare_survey
from rover_planner.viewer.state.layers import load_map
from support.command_line import assert_refused
from support.survey_maps import compute_here, make_request, make_rough_map

rasterio = pytest.importorskip("rasterio", reason="install the extra survey")

MARS = (
    'PROJCS["Mars equirectangular",GEOGCS["Mars",DATUM["Mars",SPHEROID["Mars",3396190,0]],'
    'PRIMEM["Reference",0],UNIT["degree",0.0174532925199433]],'
    'PROJECTION["Equirectangular"],PARAMETER["standard_parallel_1",0],'
    'PARAMETER["central_meridian",0],UNIT["metre",1]]'
)
LEFT, TOP, CELL = 812_345.5, -245_678.25, 0.1


def write_tif(path, heights, notes=None, **changes):
    """Write heights with row 0 in the north, and notes on its bands, such as their scales."""
    heights = np.asarray(heights)
    bands = heights if heights.ndim == 3 else heights[None]
    profile = {
        "driver": "GTiff",
        "width": bands.shape[2],
        "height": bands.shape[1],
        "count": bands.shape[0],
        "dtype": heights.dtype,
        "crs": MARS,
        "transform": rasterio.Affine(CELL, 0.0, LEFT, 0.0, -CELL, TOP),
        "tiled": True,
        "blockxsize": 64,
        "blockysize": 64,
    } | changes
    with rasterio.open(path, "w", **profile) as file:
        file.write(bands)
        for name, values in (notes or {}).items():
            setattr(file, name, values)
    return path


def test_corners_and_projection_come_back(tmp_path):
    heights = make_rough_map(20, 30).elevation.astype(np.float32)
    path = write_tif(tmp_path / "map.tif", heights[::-1], nodata=np.nan)
    prepared = compute_here(prepare_survey(make_request(), str(path), tmp_path / "out"))
    write_layers(prepared.store, tmp_path / "layers")
    with rasterio.open(path) as there:
        for name in prepared.store.notes.layers:
            with rasterio.open(tmp_path / "layers" / f"{name}.tif") as back:
                assert back.bounds == pytest.approx(there.bounds, abs=1e-9)
                assert back.transform.almost_equals(there.transform, 1e-9)
                assert back.crs == there.crs and back.shape == there.shape
                assert back.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
                layer = prepared.store.layer(name)[:]
                np.testing.assert_array_equal(back.read(1)[::-1], layer)


@pytest.mark.parametrize("kind", [np.uint64, np.float32])
def test_overviews_have_values_of_the_layer(tmp_path, kind):
    values = np.array([0, 3, 255], kind) if kind != np.float32 else np.array([0.5, np.inf], kind)
    layer = np.random.default_rng(3).choice(values, (700, 1100))
    write_cog(tmp_path / "a.tif", layer, MapFrame((700, 1100), CELL, (0.0, 0.0), MARS), 1)
    for level in range(2):
        with rasterio.open(tmp_path / "a.tif", overview_level=level) as overview:
            assert overview.shape[0] < 400
            assert set(np.unique(overview.read(1))) <= set(values)


def test_whole_numbers_with_scale_and_nodata_are_heights(tmp_path):
    values = np.full((30, 40), 1234, np.int16)
    values[3, 5], values[7, 9] = -9999, 1300
    notes = {"scales": [0.01], "offsets": [100.0]}
    path = write_tif(tmp_path / "map.tif", values, notes, nodata=-9999)
    heights = GeoTiffMap(path).read((slice(0, 30), slice(0, 40)))["elevation"]
    assert np.isnan(heights[26, 5]) and np.isnan(heights).sum() == 1
    assert heights[22, 9] == pytest.approx(113.0) and heights[0, 0] == pytest.approx(112.34)


def test_cells_of_a_mask_and_of_a_nodata_value_are_unknown(tmp_path):
    heights = np.ones((30, 40), np.float32)
    heights[3, 5] = -9999.9
    mask = np.full(heights.shape, 255, np.uint8)
    mask[7, 9] = 0
    path = write_tif(tmp_path / "map.tif", heights, nodata=-9999.9)
    with rasterio.open(path, "r+") as file:
        file.write_mask(mask)
    found = GeoTiffMap(path).read((slice(0, 30), slice(0, 40)))["elevation"][::-1]
    assert np.argwhere(np.isnan(found)).tolist() == [[3, 5], [7, 9]]


@pytest.mark.filterwarnings("ignore:The given matrix is equal to Affine.identity")
@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"heights": np.zeros((3, 40, 50), np.uint8)}, "has 3 bands; it must have one"),
        ({"transform": rasterio.Affine.identity()}, "says nowhere where its cells are"),
        ({"crs": "EPSG:4326"}, "is in degrees; it must be in a map projection in metres"),
        ({"crs": "EPSG:2263"}, "has coordinates in US survey foot"),
        # Of this one PROJ itself wrote a second line on stderr.
        ({"crs": "+proj=stere +lat_0=-90 +R=1737400 +units=km"}, "has coordinates in kilometre"),
        ({"crs": None}, "has no coordinate reference system"),
        ({"crs": 'LOCAL_CS["site",UNIT["metre",1]]'}, "is in coordinates of another kind"),
        ({"notes": {"scales": [0.0]}}, "has heights with scale 0 and offset 0"),
        ({"notes": {"units": ["ft"]}}, "has heights in 'ft'; they must be in metres"),
        ({"transform": rasterio.Affine.rotation(10) @ rasterio.Affine.scale(0.1, -0.1)},
         "is rotated or mirrored"),
        ({"transform": rasterio.Affine(0.1, 0, 0, 0, 0.1, 0)}, "is rotated or mirrored"),
        ({"transform": rasterio.Affine(0.1, 0, 0, 0, -0.2, 0)}, "has cells of 0.1 x 0.2 m"),
    ],
)  # fmt: skip
def test_a_tif_of_another_kind_is_refused_in_one_line_with_a_hint(tmp_path, capfd, changes, said):
    changes = {"heights": np.zeros((40, 50), np.float32)} | changes
    path = write_tif(tmp_path / "map.tif", **changes)
    capfd.readouterr()
    code = main(["survey", "lsr1", str(path), str(tmp_path / "out")])
    assert_refused(capfd, code, f"map.tif: {said}")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("value", "nodata", "said"),
    [
        (-9999.0, None, "-9999 and declares no nodata value"),
        (float(np.finfo(np.float32).min), None, ".* and declares no nodata value"),
        (np.inf, -9999, "inf; heights must"),
        (-2e9, -9999, r"-2e\+09; heights must"),
    ],
)
def test_heights_that_no_ground_has_are_refused_by_file_and_value(tmp_path, value, nodata, said):
    heights = np.zeros((40, 50), np.float32)
    heights[3, 4] = value
    path = write_tif(tmp_path / "a.tif", heights, nodata=nodata)
    with pytest.raises(PlanningError, match=rf"a\.tif: holds {said}") as refusal:
        GeoTiffMap(path).read((slice(0, 40), slice(0, 50)))
    if nodata is None:
        advised = float(str(refusal.value).split("-a_nodata")[1].split()[0])
        assert advised == value  # as GDAL compares it with the heights


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (0.0, "map.tif: cannot be read"),
        (0.5, "map.tif: is truncated"),
        (None, "map.tif: cannot be read"),
    ],
)
def test_a_truncated_or_missing_tif_is_refused_before_anything_is_done(
    tmp_path, share, said, capfd
):
    path = tmp_path / "map.tif"
    if share is not None:
        heights = np.random.default_rng(1).random((300, 300)).astype(np.float32)
        content = write_tif(path, heights, compress="deflate").read_bytes()
        path.write_bytes(content[: int(share * len(content))])
    assert_refused(capfd, main(["survey", "lsr1", str(path), str(tmp_path / "out")]), said)
    assert not (tmp_path / "out").exists()


def test_gaps_of_a_tif_are_not_filled_here(tmp_path):
    path = write_tif(tmp_path / "map.tif", np.zeros((40, 50), np.float32))
    with pytest.raises(PlanningError, match="max_gap is 0.2; it must be 0 for a GeoTIFF"):
        prepare_survey(make_request(), str(path), tmp_path / "out", max_gap=0.2)


def test_a_mask_or_a_nodata_value_beside_the_file_makes_another_map(tmp_path):
    heights = make_rough_map(40, 50).elevation.astype(np.float32)
    path = write_tif(tmp_path / "map.tif", heights)
    hashes = [GeoTiffMap(path).hash_content()]
    mask = np.full(heights.shape, 255, np.uint8)
    for row in (3, 20):
        mask[row, 5] = 0
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False), rasterio.open(path, "r+") as file:
            file.write_mask(mask)
        hashes.append(GeoTiffMap(path).hash_content())
    assert (tmp_path / "map.tif.msk").exists()
    note = "<PAMDataset><PAMRasterBand band='1'><Offset>{}</Offset></PAMRasterBand></PAMDataset>"
    for offset in (0, 7):
        (tmp_path / "map.tif.aux.xml").write_text(note.format(offset))
        hashes.append(GeoTiffMap(path).hash_content())
    assert GeoTiffMap(path).read((slice(0, 1), slice(0, 1)))["elevation"][0, 0] > 6.0
    assert len(set(hashes)) == 4 and hashes[3] == hashes[2]  # an offset of 0 changes no height


def test_a_thinned_map_is_read_by_parts(tmp_path):
    heights = np.random.default_rng(5).random((2100, 3000)).astype(np.float32)
    source = GeoTiffMap(write_tif(tmp_path / "map.tif", heights))
    box = slice(1, 2100), slice(0, 3000)
    source.read((slice(0, 4), slice(0, 4)))  # libraries are loaded
    tracemalloc.start()
    found = source.read(box, 7)["elevation"]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    np.testing.assert_array_equal(found, heights[::-1][box][::7, ::7])
    assert peak < 8 * heights.size


def test_page_and_survey_go_on_with_the_map_that_was_surveyed_and_none_that_has_changed(tmp_path):
    heights = make_rough_map(70, 90).elevation.astype(np.float32)
    path, moved = tmp_path / "map.tif", tmp_path / "moved.tif"
    write_tif(path, heights[::-1], nodata=np.nan)
    prepare_survey(make_request(), str(path), tmp_path / "out")
    shutil.copy(path, moved)
    assert prepare_survey(make_request(), str(moved), tmp_path / "out").chunks
    terrain = load_map(tmp_path / "out", 10_000)
    np.testing.assert_array_equal(terrain.elevation, heights.astype(float))
    assert terrain.origin == pytest.approx((LEFT + 0.5 * CELL, TOP - 69.5 * CELL))
    write_tif(path, heights[::-1] + 1, nodata=np.nan)
    with pytest.raises(PlanningError, match=r"map\.tif has changed since .*out was made"):
        load_map(tmp_path / "out", 10_000)
    with pytest.raises(PlanningError, match=r"map\.tif has changed since .*out was made"):
        prepare_survey(make_request(), str(moved), tmp_path / "out")


def test_a_damaged_block_is_refused_in_words_of_its_own(tmp_path):
    heights = np.random.default_rng(1).random((60, 60)).astype(np.float32)
    path = write_tif(tmp_path / "map.tif", heights, compress="deflate")
    with rasterio.open(path) as file:
        start = int(file.get_tag_item("BLOCK_OFFSET_0_0", "TIFF", bidx=1))
    content = bytearray(path.read_bytes())
    content[start : start + 2000] = bytes(2000)
    path.write_bytes(content)
    with pytest.raises(PlanningError, match=r"map\.tif: cannot be read: ") as refusal:
        GeoTiffMap(path).read((slice(0, 60), slice(0, 60)))
    assert "See previous exception" not in str(refusal.value)
