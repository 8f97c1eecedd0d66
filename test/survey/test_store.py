# SPDX-License-Identifier: Apache-2.0
"""A store goes on where it was left, and is never mixed with another survey."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")

from rover_physics import save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import compute_chunk
from rover_planner.survey.store import NOTES, SurveyStore
from rover_planner.survey.survey import prepare_survey, summarise
from support.grounds import raised
from support.rovers import LSR1, M2020
from support.survey_maps import (
    assert_same_bits,
    compute_here,
    layers_of,
    make_request,
    make_rough_map,
    survey_here,
)

HEAVIER = replace(LSR1, wheel=replace(LSR1.wheel, mass=0.36))


@pytest.fixture
def finished(tmp_path):
    """Return a folder with a map, whose first chunk of 16 cells is unknown, and its survey."""
    ground = raised(make_rough_map(140, 140), np.s_[:100, :100], np.nan)
    survey_here(tmp_path, ground, make_request(step=4, headings=2), chunk=16)
    return tmp_path


@pytest.fixture
def files(tmp_path):
    """Return a folder with a map that is not surveyed."""
    save_terrain(tmp_path / "map.npz", make_rough_map(70, 70))
    return tmp_path


def prepare(files, request=None, **changes):
    request = make_request() if request is None else request
    return prepare_survey(request, str(files / "map.npz"), files / "out", **changes)


def test_finished_chunks_are_not_done_again_and_half_written_or_lost_ones_are(finished):
    request = make_request(step=4, headings=2)
    prepared = prepare(finished, request)
    before = layers_of(prepared.store)
    assert prepared.chunks == []
    for lost in ("worst_tilt/c/0/0", "worst_tilt/c/2/1", "seconds/c/0/1", "seconds/c/1/1"):
        (prepared.store.path / lost).unlink()  # in the first one nothing is known
    (prepared.store.path / "best_class/c/1/1").unlink()
    told = summarise(prepared.store)
    for name in ("best_class", "worst_class"):  # shares of the cells that are there
        assert sum(told[name].values()) == pytest.approx(1.0, abs=1e-5)
    rows, columns = prepared.store.notes.layout.cells_of((1, 1))
    prepared.store._group["worst_tilt"][rows, columns] = 7.0  # it was stopped after this layer
    again = prepare(finished, request)
    assert again.chunks == [(0, 0), (0, 1), (1, 1), (2, 1)] and again.finished == 5
    assert_same_bits(layers_of(compute_here(again).store), before)
    assert prepare(finished, request).chunks == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rover": M2020}, "another rover: lsr1, not m2020"),
        ({"rover": HEAVIER}, "another rover (wheel (mass: 0.35, not 0.36))"),
        ({"policy": "optimal"}, "another options (policy: equal, not optimal)"),
        ({"headings": 8}, "another headings: 4, not 8"),
    ],
)
def test_a_store_of_another_survey_is_refused(files, changes, said):
    prepare(files)
    with pytest.raises(PlanningError) as refusal:
        prepare(files, make_request(**changes))
    assert said in str(refusal.value)


def test_a_store_of_another_map_of_other_gaps_or_of_another_version_is_refused(files, monkeypatch):
    store, box = prepare(files, max_gap=0.3).store, (slice(0, 70), slice(0, 70))
    assert not np.isnan(store.open_map().read(box)["elevation"]).any()
    with pytest.raises(PlanningError, match="another map"):
        prepare(files)
    monkeypatch.setattr("rover_physics.__version__", "99.0")
    with pytest.raises(PlanningError, match="another version: .*, not 99.0"):
        prepare(files, max_gap=0.3)
    monkeypatch.undo()
    save_terrain(files / "map.npz", raised(make_rough_map(70, 70), (5, 5), 1e-9))
    with pytest.raises(PlanningError, match="another map"):
        prepare(files, max_gap=0.3)


def test_other_chunks_are_refused_only_where_they_are_asked_for(files):
    prepare(files, chunk=64)
    with pytest.raises(PlanningError, match="has chunks of 64 cells, not 128"):
        prepare(files, chunk=128)
    assert prepare(files, chunk=50).store.notes.layout.chunk == 64
    with pytest.raises(PlanningError, match="chunk is 0; it must be 1 or more"):
        prepare(files, chunk=0)


def test_a_folder_that_is_no_survey_is_refused_and_left_alone(files):
    (files / "out").mkdir()
    (files / "out" / "thesis.tex").write_text("years of work")
    with pytest.raises(PlanningError, match="out is not a survey"):
        prepare(files)
    assert [path.name for path in (files / "out").iterdir()] == ["thesis.tex"]
    with pytest.raises(PlanningError, match="no survey"):
        SurveyStore(files / "nothing")


def test_a_new_store_is_told_from_one_where_nothing_passes_and_has_one_writer(files):
    store = prepare(files).store
    assert (store.layer("best_class")[:] == 255).all()
    assert np.isnan(store.layer("worst_tilt")[:]).all()
    refused = pytest.raises(PlanningError, match="another survey is writing into")
    with store.locked(), refused, SurveyStore(store.path).locked():
        raise AssertionError("two at once")
    with SurveyStore(store.path).locked():
        pass


def test_a_missing_layer_is_named_and_so_is_another_format(files):
    store = prepare(files).store
    shutil.rmtree(store.path / "worst_tilt")
    with pytest.raises(PlanningError, match="worst_tilt is damaged .*survey again"):
        SurveyStore(store.path)
    store._group.attrs[NOTES] = store._group.attrs[NOTES] | {"format": 1}
    with pytest.raises(PlanningError, match="a survey of format 1; it must be 2: survey again"):
        SurveyStore(store.path)


@pytest.mark.parametrize("content", [b"", b"no zstandard frame", None])
def test_a_damaged_file_is_one_line(finished, capfd, content):
    path = finished / "out"
    for name, words in (
        ("best_class", ["survey", "lsr1", finished / "map.npz", path, "--headings=2", "--step=4"]),
        ("passable_headings", ["reachable", path, "--from", "1213.3,-326.7"]),
    ):
        damaged = path / name / "c" / "2" / "2"
        damaged.write_bytes(damaged.read_bytes()[:-9] if content is None else content)
        assert main(list(map(str, words))) == 2
        out, err = capfd.readouterr()
        assert out == "" and err.count("\n") == 1
        assert f"{name} is damaged" in err and "survey again into another folder" in err


def test_files_are_on_the_disk_before_a_chunk_counts_as_finished(files, monkeypatch):
    prepared = prepare(files, make_request(step=4), chunk=64)
    chunk, path = prepared.chunks[0], prepared.store.path
    layers = compute_chunk(prepared.job.request, prepared.store, chunk)
    forced, fsync = [], os.fsync

    def force(number):
        forced.append(
            (Path(f"/proc/self/fd/{number}").readlink(), len(prepared.store.find_finished()))
        )
        fsync(number)

    monkeypatch.setattr(os, "fsync", force)
    prepared.store.write(chunk, layers, 1.0)
    before = {one for one, finished in forced if not finished}
    for name in layers:
        file = prepared.store.layer(name).file_of(chunk)
        assert {file, *file.parents[: len(file.relative_to(path).parts)]} <= before
    mark = prepared.store.layer("seconds").file_of(chunk)
    assert (mark, 1) in forced and (path, 1) in forced
