# SPDX-License-Identifier: Apache-2.0
"""Surveys with Dask: same bits however they run, and nothing lost however they end."""

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="install the extra survey")

from distributed import LocalCluster

from rover_physics.terrain.grid import save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.cluster import checks
from rover_planner.survey.cluster import client as cluster_client
from rover_planner.survey.cluster.checks import check_workers
from rover_planner.survey.cluster.client import ClusterSettings, open_client
from rover_planner.survey.cluster.runner import run_survey
from rover_planner.survey.store import SurveyStore
from rover_planner.survey.survey import prepare_survey
from support.survey_maps import (
    REPOSITORY,
    assert_same_bits,
    count_chunks,
    die_on_one,
    fail_on_one,
    finish,
    forget_package,
    make_request,
    make_rough_map,
    prepare_here,
    start_command,
    survey_here,
    wait_for_chunks,
)
from support.waiting import wait_until, wait_until_gone

SIDE = 180
"""Cells of a side of the map; it has 9 chunks."""
SHARED = ("--headings", 4, "--chunk", 64)


def layers_in(path) -> dict:
    store = SurveyStore(path)
    return {name: store.layer(name)[:] for name in store.layer_names()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a map, and the layers that this process finds on it in one chunk."""
    folder = tmp_path_factory.mktemp("survey")
    store = survey_here(folder, make_rough_map(SIDE, SIDE), make_request(), chunk=192).store
    return folder / "map.npz", layers_in(store.path)


@pytest.fixture
def ground(tmp_path) -> Path:
    """Return a map, which is not surveyed."""
    save_terrain(tmp_path / "map.npz", make_rough_map(130, 130))
    return tmp_path / "map.npz"


@pytest.fixture
def start_cluster() -> Iterator[Callable]:
    """Return what starts a cluster in this process, as one that is there already."""
    clusters = []

    def start(workers: int, **changes) -> str:
        clusters.append(LocalCluster(
            n_workers=workers, processes=False, dashboard_address=None, protocol="tcp://",
            **({"threads_per_worker": 2} | changes),
        ))  # fmt: skip
        return clusters[-1].scheduler_address

    yield start
    for cluster in clusters:
        cluster.close()


@pytest.fixture(scope="module")
def client() -> Iterator[object]:
    """Return the client of one worker in a process of its own."""
    with open_client(ClusterSettings(workers=1)) as opened:
        yield opened


# What is found.


@pytest.mark.slow
def test_two_workers_find_what_one_process_finds_and_a_second_run_does_nothing(whole, tmp_path):
    map_file, layers = whole
    words = ("survey", "lsr1", map_file, tmp_path / "out", *SHARED)
    picture = tmp_path / "p.png"
    code, report, err = finish(start_command(*words, "--workers", 2, "--picture", picture))
    assert (code, err) == (0, "")
    assert report["chunks"] == report["chunks_done"] == 9 and report["chunks_failed"] == []
    assert report["poses"] == SIDE * SIDE * 4 and report["surveyed"] == SIDE * SIDE
    assert sum(report["best_class"].values()) == pytest.approx(1.0, abs=1e-5)
    assert picture.stat().st_size > 10_000
    assert_same_bits(layers_in(tmp_path / "out"), layers)
    code, again, err = finish(start_command(*words[:-2]))
    assert (code, err) == (0, "") and again["chunks_done"] == 0 and again["chunks_found"] == 9


@pytest.mark.slow
def test_an_existing_scheduler_does_the_work(whole, tmp_path, start_cluster):
    map_file, layers = whole
    words = ["survey", "lsr1", map_file, tmp_path / "out", *SHARED]
    assert main([*map(str, words), "--scheduler", start_cluster(1)]) == 0
    assert_same_bits(layers_in(tmp_path / "out"), layers)


# What ends early.


def children_of(pid) -> list[int]:
    """Return the worker processes of a command."""
    found = []
    children = (path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))
    for child in " ".join(children).split():
        if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
            found.append(int(child))
    return found


LONG = pytest.mark.long


@pytest.mark.slow
@pytest.mark.parametrize(
    "how",
    [signal.SIGINT, *(pytest.param(one, marks=LONG) for one in
                      (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP))],
)  # fmt: skip
def test_a_killed_command_leaves_no_worker_and_goes_on_where_it_was(whole, tmp_path, how):
    map_file, layers = whole
    out = tmp_path / "out"
    words = ("survey", "lsr1", map_file, out, *SHARED, "--workers", 2)
    process = start_command(*words)
    try:
        wait_for_chunks(out, 1)
        workers = children_of(process.pid)
        assert len(workers) == 2
        process.send_signal(how)
        _, err = process.communicate(timeout=200)
    finally:
        process.kill()
    if how != signal.SIGKILL:
        assert (process.returncode, err) == (130, "")
    for worker in workers:
        wait_until_gone(worker, 60.0)
    done = count_chunks(out)
    assert 1 <= done < 9
    code, report, err = finish(start_command(*words))
    assert (code, err) == (0, "")
    assert report["chunks_found"] == done and report["chunks_done"] == 9 - done
    assert_same_bits(layers_in(out), layers)


@pytest.mark.long
def test_a_killed_worker_costs_only_its_chunks_time(whole, tmp_path):
    map_file, layers = whole
    out = tmp_path / "out"
    process = start_command("survey", "lsr1", map_file, out, *SHARED, "--workers", 2)
    try:
        wait_for_chunks(out, 1)
        os.kill(children_of(process.pid)[0], signal.SIGKILL)
        code, report, err = finish(process)
    finally:
        process.kill()
    assert (code, err) == (0, "") and report["chunks_done"] == 9
    assert_same_bits(layers_in(out), layers)


def start_dask(*words) -> subprocess.Popen:
    """Start a program of Dask."""
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{words[0]}", *map(str, words[1:])],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.mark.long
def test_a_scheduler_that_dies_is_one_line_and_what_is_finished_stays(whole, tmp_path):
    out, scheduler_file = tmp_path / "out", tmp_path / "scheduler.json"
    scheduler = start_dask("dask_scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard",
                           "--scheduler-file", scheduler_file)  # fmt: skip
    worker = process = None
    try:
        wait_until(
            lambda: scheduler_file.exists() and scheduler_file.stat().st_size, "a scheduler", 120.0
        )
        worker = start_dask("dask_worker", "--scheduler-file", scheduler_file, "--nthreads", 1,
                            "--no-dashboard", "--no-nanny")  # fmt: skip
        address = scheduler_file.read_text().split('"address": "')[1].split('"')[0]
        process = start_command("survey", "lsr1", whole[0], out, "--headings", 16, "--chunk", 64,
                                "--scheduler", address)  # fmt: skip
        wait_for_chunks(out, 1)
        scheduler.kill()
        _, err = process.communicate(timeout=200)
    finally:
        for one in (scheduler, worker, process):
            if one is not None:
                one.kill()
                one.wait(timeout=30)
    assert process.returncode == 2, err
    assert "the scheduler is gone; finished chunks are kept" in err and err.count("\n") == 1, err
    assert SurveyStore(out).find_finished()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "why"),
    [
        (fail_on_one, "RuntimeError: this chunk is cursed"),
        pytest.param(die_on_one, "its worker died 3 times", marks=LONG),
    ],
)
def test_a_chunk_that_fails_three_times_is_named_and_the_rest_stands(
    tmp_path, task, why, start_cluster
):
    dies = task is die_on_one
    settings = ClusterSettings(workers=1) if dies else ClusterSettings(start_cluster(1))
    prepared = prepare_here(tmp_path, make_rough_map(120, 120), make_request(), chunk=64)
    outcome = run_survey(prepared.job, prepared.chunks, settings, task=task)
    assert outcome.failed == {(0, 1): why} and outcome.done == 3
    again = prepare_survey(make_request(), str(tmp_path / "map.npz"), tmp_path / "out")
    assert again.chunks == [(0, 1)]
    cells = again.job.layout.cells_of((0, 1))
    assert (again.store.layer("best_class")[cells] == 255).all()
    assert (again.store.layer("best_class")[:] == 255).sum() == 64 * 56


def limit_files(most: int) -> Callable[[], None]:
    """Return what limits the size of files, as a full disk cannot be had without rights."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

    return limit


@pytest.mark.slow
@pytest.mark.parametrize("writes_layers", [False, True])
def test_no_space_left_is_one_line_and_what_is_there_is_whole(tmp_path, writes_layers):
    pytest.importorskip("rasterio", reason="install the extra survey")
    prepared = prepare_here(tmp_path, make_rough_map(120, 120), make_request(), chunk=64)
    words = [sys.executable, "-m", "rover_planner", "survey", "lsr1", tmp_path / "map.npz",
             tmp_path / "out", *SHARED[:2], "--workers", 1]  # fmt: skip
    if writes_layers:
        survey_here(tmp_path, make_rough_map(120, 120), make_request())
        words += ["--geotiff", tmp_path / "layers"]
    ended = subprocess.run([*map(str, words)], capture_output=True, text=True, timeout=200,
                           preexec_fn=limit_files(10_000 if writes_layers else 1500))  # fmt: skip
    assert ended.returncode == 2 and ended.stderr.count("\n") == 1, ended.stderr
    if writes_layers:
        assert ".tif: cannot be written: File too large" in ended.stderr
        rasterio = pytest.importorskip("rasterio")
        for path in (tmp_path / "layers").iterdir():
            with rasterio.open(path) as layer:
                layer.read()
    else:
        assert "cannot be written: File too large; finished chunks are kept" in ended.stderr
        left = prepare_survey(make_request(), str(tmp_path / "map.npz"), tmp_path / "out")
        assert left.chunks == prepared.chunks


# Workers.


@pytest.mark.slow
def test_dask_at_rest_looks_around_once_a_second(client):
    """At 50 times a second, each of its servers takes a percent of a core."""

    def find_period(dask_worker) -> float:
        return dask_worker.periodic_callbacks["tick"].callback_time

    def find_scheduler_period(dask_scheduler) -> float:
        return dask_scheduler.periodic_callbacks["tick"].callback_time

    assert set(client.run(find_period).values()) == {1000.0}
    assert client.run_on_scheduler(find_scheduler_period) == 1000.0


@pytest.mark.slow
def test_workers_of_another_version_or_place_are_refused(ground, client):
    job = prepare_survey(make_request(), str(ground), ground.with_name("out")).job
    elsewhere = ground.with_name("elsewhere")
    check_workers(job, client)
    with pytest.raises(PlanningError, match=r"worker tcp://.* has version .*, not 99\.0"):
        check_workers(replace(job, version="99.0"), client)
    with pytest.raises(PlanningError, match=f"does not see {elsewhere}"):
        check_workers(replace(job, store=elsewhere), client)
    client.run(forget_package)  # the last test of this worker
    with pytest.raises(PlanningError, match="cannot import rover_planner: "):
        check_workers(job, client)


@pytest.mark.slow
def test_a_scheduler_without_workers_or_with_small_ones_is_refused(
    ground, monkeypatch, capfd, start_cluster
):
    monkeypatch.setattr(checks, "WORKERS_TIME", 0.3)
    prepared = prepare_survey(make_request(), str(ground), ground.with_name("other"), 64)
    with pytest.raises(PlanningError, match=r"has had no worker for 0\.3 s; start some"):
        run_survey(prepared.job, prepared.chunks, ClusterSettings(start_cluster(0)))
    capfd.readouterr()
    out = ground.with_name("out")
    small = start_cluster(1, memory_limit="300MB", threads_per_worker=1)
    assert main(["survey", "lsr1", str(ground), str(out), "--scheduler", small]) == 2
    err = capfd.readouterr().err
    assert "a worker has 300 MB: give a smaller --chunk" in err and not out.exists()


# Bad input.


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--headings", "65"], "headings is 65; it must be 1 to 64"),
        (["--policy", "magic"], "no torque policy 'magic'"),
        (["--friction", "-1"], "friction is -1.0"),
        (["--sigmas", "nan"], "sigmas"),
        (["--chunk", "-5"], "chunk is -5"),
        (["--max-cells", "99"], "the limit is 99"),
        (["--max-gap", "-1"], "max_gap is -1.0"),
        (["--workers", "0"], "--workers"),
        (["--workers", "100000"], "100000 workers need "),
        (["--memory-limit", "lots"], "memory limit is 'lots'; it must be a size such as 1GiB"),
        (["--memory-limit", "100MB"], "a worker has 100 MB: give a smaller --chunk"),
        (["--scheduler", "elsewhere"], "scheduler is 'elsewhere'; it must be an address"),
        (["--scheduler", "tcp://127.0.0.1:9"], "no scheduler at tcp://127.0.0.1:9"),
        (["--scheduler", "tcp://127.0.0.1:9", "--workers", "2"], "--workers is 2; leave it out"),
        (["--scheduler", "tcp://127.0.0.1:9", "--memory-limit", "1GB"], "--memory-limit is 1GB"),
        (["--picture", "/no/such/p.png"], "there is no folder /no/such"),
        (["--picture", "p.xyz"], "must be a .png"),
        (["--geotiff", "/proc/no"], "/proc/no: cannot be made"),
    ],
)
def test_bad_input_is_one_line_before_a_store_is_made(ground, monkeypatch, words, said, capfd):
    monkeypatch.setattr(cluster_client, "CONNECT_TIME", 0.5)
    out = ground.with_name("out")
    assert main(["survey", "lsr1", str(ground), str(out), *words]) == 2
    err = capfd.readouterr().err
    assert said in err and err.count("\n") == 1 and not out.exists()
