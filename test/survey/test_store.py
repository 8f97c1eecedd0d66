"""A store goes on where it was left, and is never mixed with another survey."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import compute_chunk
from rover_planner.survey.disk.durable_store import write_durably
from rover_planner.survey.store import NOTES, SurveyStore
from rover_planner.survey.survey import prepare_survey
from support.survey_maps import (
    assert_same_bits,
    layers_of,
    make_request,
    make_rough_map,
    survey_here,
)


@pytest.fixture
def files(tmp_path):
    save_terrain(tmp_path / "map.npz", make_rough_map(140, 140))
    return tmp_path


def prepare(files, request=None, **changes):
    request = make_request() if request is None else request
    return prepare_survey(request, str(files / "map.npz"), files / "out", **changes)


def test_finished_chunks_are_not_done_again_and_half_written_ones_are(files):
    prepared = prepare(files, chunk=64)
    assert len(prepared.chunks) == 9 and prepared.finished == 0
    for chunk in prepared.chunks[:4]:
        prepared.store.write(chunk, compute_chunk(prepared.job, chunk), 1.0)
    half = prepared.chunks[4]
    rows, columns = prepared.job.layout.cells_of(half)
    prepared.store.layer("worst_tilt")[rows, columns] = 7.0  # it was stopped after this layer
    again = prepare(files)
    assert again.finished == 4 and again.chunks == prepared.chunks[4:]
    for chunk in again.chunks:
        again.store.write(chunk, compute_chunk(again.job, chunk), 1.0)
    assert prepare(files).chunks == []
    whole = survey_here(files / "whole", make_rough_map(140, 140), make_request(), chunk=192)
    assert_same_bits(layers_of(again), layers_of(whole))


def test_a_failed_chunk_is_not_finished(files):
    prepared = prepare(files, chunk=64)
    prepared.store.mark_failed((1, 2))
    assert prepare(files).chunks == prepared.chunks


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rover": load_rover("m2020")}, "another rover: lsr1, not m2020"),
        ({"policy": "optimal"}, "another options (policy: equal, not optimal)"),
        ({"headings": 8}, "another headings: 4, not 8"),
        ({"step": 2}, "another step: 1, not 2"),
        ({"turns": True}, "another turns: False, not True"),
        ({"sigmas": 0.0}, "another sigmas: 3.0, not 0.0"),
    ],
)
def test_a_store_of_another_survey_is_refused(files, changes, said):
    prepare(files)
    rover = changes.pop("rover", None)
    request = make_request(**changes)
    with pytest.raises(PlanningError) as refusal:
        prepare(files, request if rover is None else replace(request, rover=rover))
    assert said in str(refusal.value)


def test_a_rover_of_the_same_name_but_other_numbers_is_another(files):
    prepare(files)
    rover = load_rover("lsr1")
    heavier = replace(rover, wheel=replace(rover.wheel, mass=0.36))
    with pytest.raises(PlanningError, match=r"another rover \(wheel \(mass: 0.35, not 0.36\)\)"):
        prepare(files, replace(make_request(), rover=heavier))


def test_a_store_of_another_map_or_version_is_refused(files, monkeypatch):
    prepare(files)
    monkeypatch.setattr("rover_physics.__version__", "99.0")
    with pytest.raises(PlanningError, match="another version: .*, not 99.0"):
        prepare(files)
    monkeypatch.undo()
    terrain = make_rough_map(140, 140)
    heights = terrain.elevation.copy()
    heights[5, 5] += 1e-9
    save_terrain(files / "map.npz", replace(terrain, elevation=heights))
    with pytest.raises(PlanningError, match="another map"):
        prepare(files)


def test_other_chunks_are_refused_only_where_they_are_asked_for(files):
    prepare(files, chunk=64)
    with pytest.raises(PlanningError, match="has chunks of 64 cells, not 128"):
        prepare(files, chunk=128)
    assert prepare(files, chunk=50).job.layout.chunk == 64
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


def test_two_commands_do_not_write_into_one_store(files):
    store = prepare(files).store
    refused = pytest.raises(PlanningError, match="another survey is writing into")
    with store.locked(), refused, SurveyStore(store.path).locked():
        raise AssertionError("two at once")
    with SurveyStore(store.path).locked():
        pass


def test_a_store_that_cannot_be_created_leaves_nothing_behind(files):
    (files / "out").write_text("a file")
    with pytest.raises(PlanningError, match="is not a survey"):
        prepare(files)
    missing = files / "no" / "such"
    with pytest.raises(PlanningError, match="cannot be written: "):
        prepare_survey(make_request(), str(files / "map.npz"), files / "map.npz" / "out")
    assert not missing.exists()


def test_the_notes_name_classes_and_limits(files):
    store = prepare(files).store
    notes = store._group.attrs[NOTES]
    assert json.loads(json.dumps(notes)) == notes
    assert notes["classes"]["0"] == "passable" and notes["limits"]["12"] == "friction"
    assert notes["description"]["rover"]["name"] == "lsr1"
    assert store.notes.to_dict() == notes


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"headings": 0}, "headings is 0; it must be 1 to 64"),
        ({"headings": 65}, "headings is 65"),
        ({"step": 0}, "step is 0; it must be 1 to 10000"),
    ],
)
def test_impossible_numbers_are_refused(changes, said):
    with pytest.raises(PlanningError, match=said):
        make_request(**changes)


def test_filled_gaps_are_another_map(files):
    filled = prepare(files, max_gap=0.3)
    assert not np.isnan(
        filled.job.open_map().read((slice(0, 140), slice(0, 140)))["elevation"]
    ).any()
    with pytest.raises(PlanningError, match="another map"):
        prepare(files)


def test_cells_that_are_not_surveyed_say_so(files):
    store = prepare(files).store
    assert (store.layer("best_class")[:] == 255).all()
    assert np.isnan(store.layer("worst_tilt")[:]).all()
    assert not store.layer("passable_headings")[:].any()


@pytest.mark.parametrize("name", ["best_class", "worst_tilt", "seconds"])
def test_a_missing_layer_is_named(files, name):
    path = prepare(files).store.path
    shutil.rmtree(path / name)
    with pytest.raises(PlanningError, match=f"{name} is damaged .*survey again"):
        SurveyStore(path)


@pytest.mark.parametrize("name", ["best_class", "passable_headings", "worst_tilt"])
def test_a_chunk_that_lost_a_file_is_done_again(files, name):
    save_terrain(files / "map.npz", make_unknown_corner())
    prepared = prepare(files, chunk=64)
    for chunk in prepared.chunks:
        prepared.store.write(chunk, compute_chunk(prepared.job, chunk), 1.0)
    before = layers_of(prepared)
    assert prepare(files).chunks == []
    for lost in ((0, 0), (2, 1)):  # in the first one nothing is known
        (prepared.store.path / name / "c" / str(lost[0]) / str(lost[1])).unlink()
    again = prepare(files)
    assert again.chunks == [(0, 0), (2, 1)] and again.finished == 7
    for chunk in again.chunks:
        again.store.write(chunk, compute_chunk(again.job, chunk), 1.0)
    assert_same_bits(layers_of(again), before)
    assert prepare(files).chunks == []


def make_unknown_corner() -> Terrain:
    """Return a map whose first chunk of 64 cells is unknown."""
    ground = make_rough_map(140, 140)
    elevation = ground.elevation.copy()
    elevation[:100, :100] = np.nan
    return replace(ground, elevation=elevation)


def test_a_store_of_another_format_is_refused(files):
    store = prepare(files).store
    store._group.attrs[NOTES] = store._group.attrs[NOTES] | {"format": 1}
    with pytest.raises(PlanningError, match="a survey of format 1; it must be 2: survey again"):
        SurveyStore(store.path)


@pytest.mark.parametrize("content", [b"", b"no zstandard frame", None])
@pytest.mark.parametrize("words", [["reachable", "--from", "1203,-337"], ["survey"]])
def test_a_damaged_file_is_one_line(files, capfd, content, words):
    prepared = prepare(files, chunk=192)
    for chunk in prepared.chunks:
        prepared.store.write(chunk, compute_chunk(prepared.job, chunk), 1.0)
    path = prepared.store.path
    name = "passable_headings" if words[0] == "reachable" else "best_class"
    damaged = path / name / "c" / "0" / "0"
    damaged.write_bytes(damaged.read_bytes()[:-9] if content is None else content)
    if words[0] == "survey":
        words = ["survey", "lsr1", str(files / "map.npz"), str(path), "--headings", "4"]
    else:
        words = ["reachable", str(path), *words[1:]]
    assert main(words) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1
    assert f"{name} is damaged" in err and "survey again into another folder" in err


def test_files_are_on_the_disk_before_a_chunk_counts_as_finished(files, monkeypatch):
    prepared = prepare(files, chunk=64)
    chunk = prepared.chunks[0]
    layers = compute_chunk(prepared.job, chunk)
    done, fsync, replace_file = [], os.fsync, Path.replace

    def force(number):
        done.append(("forced", Path(f"/proc/self/fd/{number}").readlink()))
        fsync(number)

    def rename(path, target):
        done.append(("renamed", path, target))
        return replace_file(path, target)

    monkeypatch.setattr(os, "fsync", force)
    monkeypatch.setattr(Path, "replace", rename)
    prepared.store.write(chunk, layers, 1.0)
    renamed = [(k, event) for k, event in enumerate(done) if event[0] == "renamed"]
    assert len(renamed) == len(layers) + 1
    for k, (_, aside, target) in renamed:
        assert ("forced", aside) in done[:k]
        folders = [target.parent, *target.parent.parents]
        for folder in folders[: folders.index(prepared.store.path) + 1]:
            assert ("forced", folder) in done[k:]
    k, (_, _, last) = renamed[-1]
    assert last.relative_to(prepared.store.path).parts[0] == "seconds"
    assert done[k - 2][0] == "forced" and done[k - 2][1] == prepared.store.path


def test_a_file_that_was_not_renamed_is_not_seen(files):
    prepared = prepare(files, chunk=64)
    chunk = prepared.chunks[0]
    prepared.store.write(chunk, compute_chunk(prepared.job, chunk), 1.0)
    folder = prepared.store.path / "seconds" / "c" / "0"
    (folder / ".1.0123.partial").write_bytes(b"half of it")
    assert prepare(files).finished == 1
    with pytest.raises(OSError, match="No such file"):
        write_durably(Path("/proc/no/such"), b"", Path("/proc"))
