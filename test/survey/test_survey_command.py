# SPDX-License-Identifier: Apache-2.0
"""Surveys with Dask: same bits however they run, and one line where they cannot go on."""

import errno
import json
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("distributed", reason="install the extra survey")

import dask
from distributed import LocalCluster

from rover_physics import load_terrain, save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.shell.run_program import end_as_by_ctrl_c
from rover_planner.survey import dask_cluster
from rover_planner.survey.chunk_survey import survey_chunk
from rover_planner.survey.cog import write_layers
from rover_planner.survey.dask_cluster import ClusterSettings, check_workers, open_client
from rover_planner.survey.layout import Index
from rover_planner.survey.runner import run_survey
from rover_planner.survey.store import create_store
from rover_planner.survey.survey import prepare_survey
from support.command_line import assert_refused
from support.survey_maps import (
    assert_same_bits,
    compute_here,
    fail_on_one,
    layers_of,
    make_request,
    make_rough_map,
    prepare_here,
    survey_here,
)
from support.waiting import wait_until


@pytest.fixture
def ground(tmp_path) -> Path:
    """Return a map that is not surveyed; at each fourth cell it has 4 chunks of 16 cells."""
    save_terrain(tmp_path / "map.npz", make_rough_map(70, 70))
    return tmp_path / "map.npz"


def start_cluster(workers: int, **changes) -> LocalCluster:
    """Start a cluster in this process, as one that is there already."""
    words = {"threads_per_worker": 2, "dashboard_address": None, "protocol": "tcp://"} | changes
    return LocalCluster(n_workers=workers, processes=False, **words)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Return the address of a cluster that is there already."""
    with start_cluster(1) as started:
        yield started.scheduler_address


def survey(map_file, *words) -> int:
    """Survey a map at 4 headings into `out` beside it; return the exit code."""
    out = map_file.with_name("out")
    return main(["survey", "lsr1", str(map_file), str(out), "--headings", "4", *map(str, words)])


# What is found.


@pytest.mark.slow
def test_a_cluster_finds_what_one_process_finds_and_a_second_run_does_nothing(
    tmp_path, ground, scheduler, capfd
):
    request, picture = make_request(step=4), tmp_path / "p.png"
    whole = survey_here(tmp_path / "whole", load_terrain(ground), request, chunk=48)
    words = ground, "--step", 4, "--picture", picture
    assert survey(*words, "--chunk", 16, "--scheduler", scheduler) == 0
    out, err = capfd.readouterr()
    report = json.loads(out)
    assert err == "" and report["chunks"] == report["chunks_done"] == 4
    assert report["chunks_failed"] == [] and report["poses"] == 18 * 18 * 4
    assert sum(report["best_class"].values()) == pytest.approx(1.0, abs=1e-5)
    assert picture.stat().st_size > 10_000
    done = prepare_survey(request, str(ground), tmp_path / "out")
    assert_same_bits(layers_of(done.store), layers_of(whole.store))
    (tmp_path / "out" / ".lock").unlink()
    (tmp_path / "out" / ".lock").mkdir()  # as on a read-only disk, to which nothing is written
    assert survey(*words) == 0
    again = json.loads(capfd.readouterr().out)
    assert again["chunks_done"] == 0 and again["chunks_found"] == 4


# What cannot go on.


@pytest.mark.slow
def test_a_chunk_that_fails_is_named_and_the_rest_stands(tmp_path, scheduler):
    prepared = prepare_here(tmp_path, make_rough_map(120, 120), make_request(step=4), chunk=16)
    settings = ClusterSettings(scheduler)
    outcome = run_survey(prepared.job, prepared.chunks, settings, task=fail_on_one)
    assert outcome.failed == {(0, 1): "RuntimeError: this chunk is cursed after 3 attempts"}
    assert outcome.done == 3
    again = prepare_survey(make_request(step=4), str(tmp_path / "map.npz"), tmp_path / "out")
    assert again.chunks == [(0, 1)]
    full = OSError(errno.ENOSPC, "No room")
    with pytest.raises(PlanningError, match="cannot be written: No room; finished chunks are ke"):
        run_survey(again.job, again.chunks, settings, task=lambda *_: full)


def test_a_survey_ends_when_no_worker_is_left(tmp_path):
    """A worker of this machine that did not start again had the survey wait for ever."""
    prepared = prepare_here(tmp_path, make_rough_map(40, 40), make_request(step=4), chunk=16)
    settings = dask_cluster.SETTINGS | {"distributed.scheduler.no-workers-timeout": "1s"}
    assert settings.keys() == dask_cluster.SETTINGS.keys()  # it is one of the survey's own
    with dask.config.set(settings), start_cluster(1) as started:

        def lose_the_worker() -> Iterator[Index]:
            started.scale(0)
            wait_until(lambda: not started.scheduler.workers, "the worker to be gone")
            yield from prepared.chunks

        with pytest.raises(PlanningError, match="has no worker any more; finished chunks are"):
            run_survey(prepared.job, lose_the_worker(), ClusterSettings(started.scheduler_address))


@contextmanager
def small_files(most: int) -> Iterator[None]:
    """Limit the size of files [bytes], as a full disk cannot be had without rights."""
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
        signal.signal(signal.SIGXFSZ, before)


def test_on_a_full_disk_a_chunk_is_refused_and_what_is_there_is_whole(tmp_path):
    rasterio = pytest.importorskip("rasterio", reason="install the extra survey")
    prepared = prepare_here(tmp_path, make_rough_map(64, 64), make_request(headings=1))
    with small_files(1500):
        refusal = survey_chunk(prepared.job, (0, 0))  # raised, it would be surveyed again
    assert isinstance(refusal, OSError) and refusal.strerror == "File too large"
    assert not prepared.store.find_finished()
    compute_here(prepared)
    refused = pytest.raises(PlanningError, match=r"\.tif: cannot be written: File too large")
    with small_files(10_000), refused:
        write_layers(prepared.store, tmp_path / "layers")
    for path in (tmp_path / "layers").iterdir():
        with rasterio.open(path) as layer:
            layer.read()


def test_a_store_that_is_created_by_two_commands_is_that_of_the_first(ground):
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


def test_signals_end_a_survey_but_those_that_are_ignored_stay_so():
    before = {one: signal.getsignal(one) for one in (signal.SIGHUP, signal.SIGTERM)}
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with end_as_by_ctrl_c():
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


# Workers.


@pytest.mark.slow
def test_workers_of_another_kind_are_refused(ground):
    job = prepare_survey(make_request(), str(ground), ground.with_name("out")).job
    elsewhere = ground.with_name("elsewhere")
    with open_client(ClusterSettings(workers=1)) as client:
        workers = list(client.nthreads())
        check_workers(job, client, workers)
        with pytest.raises(PlanningError, match=r"worker tcp://.* has version .*, not 99\.0"):
            check_workers(replace(job, version="99.0"), client, workers)
        with pytest.raises(PlanningError, match=f"does not see {elsewhere}"):
            check_workers(replace(job, store=elsewhere), client, workers)
        client.run(exec, "import sys; sys.modules['rover_physics'] = None")
        with pytest.raises(PlanningError, match="cannot import rover_planner: "):
            check_workers(job, client, workers)


@pytest.mark.slow
def test_a_scheduler_without_workers_or_with_small_ones_is_refused(ground, monkeypatch, capfd):
    monkeypatch.setattr(dask_cluster, "WORKERS_TIME", 0.3)
    prepared = prepare_survey(make_request(), str(ground), ground.with_name("other"), 64)
    refused = pytest.raises(PlanningError, match=r"has had no worker for 0\.3 s; start some")
    with start_cluster(0) as started, refused:
        run_survey(prepared.job, prepared.chunks, ClusterSettings(started.scheduler_address))
    capfd.readouterr()
    with start_cluster(1, memory_limit="300MB", threads_per_worker=1) as started:
        code = survey(ground, "--scheduler", started.scheduler_address)
    assert_refused(capfd, code, "a worker has 300 MB: give a smaller --chunk")
    assert not ground.with_name("out").exists()


# Bad input.


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--headings", "65"], "headings is 65; it must be 1 to 64"),
        (["--step", "0"], "step is 0; it must be 1 to 10000"),
        (["--policy", "servo"], "policy 'servo' has no bounds"),
        (["--workers", "100000"], "100000 workers need "),
        (["--memory-limit", "lots"], "memory limit is 'lots'; it must be a size such as 1GiB"),
        (["--memory-limit", "100MB"], "a worker has 100 MB: give a smaller --chunk"),
        (["--scheduler", "elsewhere"], "scheduler is 'elsewhere'; it must be an address"),
        (["--scheduler", "tcp://127.0.0.1:9"], "no scheduler at tcp://127.0.0.1:9"),
        (["--scheduler", "tcp://127.0.0.1:9", "--workers", "2"], "--workers is 2; leave it out"),
        (["--picture", "/no/such/p.png"], "there is no folder /no/such"),
        (["--geotiff", "/proc/no"], "/proc/no: cannot be made"),
    ],
)
def test_bad_input_is_one_line_before_a_store_is_made(ground, monkeypatch, words, said, capfd):
    known = load_terrain(ground)
    save_terrain(ground, replace(known, elevation_std=0.01 * np.abs(known.elevation)))
    monkeypatch.setattr(dask_cluster, "CONNECT_TIME", 0.5)
    assert_refused(capfd, survey(ground, *words), said)
    assert not ground.with_name("out").exists()
