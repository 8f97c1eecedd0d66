# SPDX-License-Identifier: Apache-2.0
"""Surveys that cannot go on end in one line, in order, and leave what they found."""

import math
import signal
import threading

import numpy as np
import pytest

pytest.importorskip("distributed", reason="install the extra survey")

from rover_physics.terrain.grid import save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.store import create_store
from rover_planner.survey.survey import prepare_survey
from support.survey_maps import (
    make_request,
    make_rough_map,
    survey_here,
)


@pytest.fixture
def ground(tmp_path):
    save_terrain(tmp_path / "map.npz", make_rough_map(70, 70))
    return tmp_path / "map.npz"


def test_a_chunk_beyond_this_machine_is_refused_before_a_store_is_made(tmp_path, capfd):
    rasterio = pytest.importorskip("rasterio", reason="install the extra survey")
    side = 64 * 3125  # cells; the file has none of its blocks
    with rasterio.open(
        tmp_path / "map.tif", "w", driver="GTiff", width=side, height=side, count=1,
        dtype="float32", nodata=math.nan, crs="EPSG:32633", tiled=True, blockxsize=8192,
        blockysize=8192, SPARSE_OK=True, BIGTIFF="YES",
        transform=rasterio.Affine(1.0, 0.0, 5e5, 0.0, -1.0, 5e6),
    ):  # fmt: skip
        pass
    words = ["survey", "lsr1", str(tmp_path / "map.tif"), str(tmp_path / "out")]
    assert main([*words, "--chunk", str(side)]) == 2
    err = capfd.readouterr().err
    assert f"a chunk of {side} x {side} cells needs" in err and "a worker has" in err
    assert err.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_store_that_is_created_by_two_commands_is_that_of_the_first(ground, monkeypatch):
    out = ground.with_name("out")
    prepared = prepare_survey(make_request(), str(ground), out, 64)
    before = (out / "zarr.json").read_bytes()
    create_store(out, prepared.store.notes, None)
    assert (out / "zarr.json").read_bytes() == before
    assert sorted(path.name for path in ground.parent.iterdir()) == ["map.npz", "out"]


def test_an_interrupted_creation_leaves_nothing_behind(ground, monkeypatch):
    def interrupt(*words):
        raise KeyboardInterrupt

    monkeypatch.setattr("rover_planner.survey.store.keep_map", interrupt)
    with pytest.raises(KeyboardInterrupt):
        prepare_survey(make_request(), str(ground), ground.with_name("out"), 64)
    assert [path.name for path in ground.parent.iterdir()] == ["map.npz"]


def test_a_lock_that_cannot_be_written_is_bad_input(ground):
    out = ground.with_name("out")
    store = prepare_survey(make_request(), str(ground), out, 64).store
    (out / ".lock").mkdir()  # as a read-only disk cannot be had without rights
    refused = pytest.raises(PlanningError, match="out: cannot be written: Is a directory")
    with refused, store.locked():
        raise AssertionError


def test_a_finished_survey_is_drawn_from_where_nothing_can_be_written(tmp_path, capfd):
    survey_here(tmp_path, make_rough_map(70, 70), make_request(), chunk=64)
    (tmp_path / "out" / ".lock").mkdir()
    words = ["survey", "lsr1", str(tmp_path / "map.npz"), str(tmp_path / "out"), "--headings", "4"]
    assert main([*words, "--picture", str(tmp_path / "p.png")]) == 0
    assert (tmp_path / "p.png").exists() and capfd.readouterr().err == ""


@pytest.mark.slow
def test_a_damaged_block_of_a_tif_is_named(tmp_path, capfd):
    rasterio = pytest.importorskip("rasterio")
    heights = np.random.default_rng(1).random((60, 60)).astype(np.float32)
    path = tmp_path / "map.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=60, height=60, count=1, dtype="float32",
        crs="EPSG:32633", transform=rasterio.Affine(0.1, 0, 5e5, 0, -0.1, 5e6),
        compress="deflate",
    ) as file:  # fmt: skip
        file.write(heights, 1)
    with rasterio.open(path) as file:
        start = int(file.get_tag_item("BLOCK_OFFSET_0_0", "TIFF", bidx=1))
    content = bytearray(path.read_bytes())
    content[start : start + 2000] = bytes(2000)
    path.write_bytes(content)
    words = ["survey", "lsr1", str(path), str(tmp_path / "out"), "--headings", "1"]
    assert main([*words, "--workers", "1"]) == 1
    err = capfd.readouterr().err
    assert "chunks [0, 0] failed: PlanningError: " in err and "map.tif: cannot be read: " in err
    assert "See previous exception" not in err and err.count("\n") == 1


def test_signals_that_are_ignored_stay_so():
    from rover_planner.shell.end_signals import end_as_by_ctrl_c

    before = {one: signal.getsignal(one) for one in (signal.SIGHUP, signal.SIGTERM)}
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with end_as_by_ctrl_c():
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            assert callable(signal.getsignal(signal.SIGTERM))
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def test_another_thread_may_run_a_survey():
    from rover_planner.shell.end_signals import end_as_by_ctrl_c

    done = []

    def enter():
        with end_as_by_ctrl_c():
            done.append(True)

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join(timeout=10.0)
    assert done == [True]
