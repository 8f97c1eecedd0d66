"""Surveys that cannot go on end in one line, in order, and leave what they found."""

import math
import os
import resource
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

pytest.importorskip("distributed", reason="install the extra survey")

from rover_physics.terrain.grid import save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.cluster import checks
from rover_planner.survey.cluster.client import ClusterSettings, open_client
from rover_planner.survey.cluster.runner import run_survey
from rover_planner.survey.store import SurveyStore, create_store
from rover_planner.survey.survey import prepare_survey
from support.survey_maps import (
    REPOSITORY,
    make_request,
    make_rough_map,
    start_command,
    survey_here,
    wait_for_chunks,
)
from support.waiting import wait_until

LONG = ("--headings", 16, "--chunk", 64)
"""Options of a survey of seconds, so that it is under way when it is told to end."""


@pytest.fixture
def ground(tmp_path):
    save_terrain(tmp_path / "map.npz", make_rough_map(130, 130))
    return tmp_path / "map.npz"


def start_dask(*words) -> subprocess.Popen:
    """Start a program of Dask."""
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{words[0]}", *map(str, words[1:])],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--workers", "100000"], "100000 workers need "),
        (["--memory-limit", "100MB"], "a worker has 100 MB: give a smaller --chunk"),
        (["--scheduler", "tcp://127.0.0.1:9", "--workers", "2"], "--workers is 2; leave it out"),
        (["--scheduler", "tcp://127.0.0.1:9", "--memory-limit", "1GB"], "--memory-limit is 1GB"),
        (["--picture", "/no/such/p.png"], "there is no folder /no/such"),
        (["--picture", "p.xyz"], "must be a .png"),
        (["--geotiff", "/proc/no"], "/proc/no: cannot be made"),
    ],
)
def test_what_cannot_end_well_is_refused_before_a_store_is_made(ground, words, said, capfd):
    out = ground.with_name("out")
    assert main(["survey", "lsr1", str(ground), str(out), *words]) == 2
    err = capfd.readouterr().err
    assert said in err and err.count("\n") == 1 and not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize("workers", [("--workers", "1"), ()])
def test_a_chunk_beyond_this_machine_is_refused_before_a_store_is_made(tmp_path, workers, capfd):
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
    assert main([*words, "--chunk", str(side), *workers]) == 2
    err = capfd.readouterr().err
    assert f"a chunk of {side} x {side} cells needs" in err and "a worker has" in err
    assert err.count("\n") == 1 and not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_chunk_beyond_the_workers_of_a_scheduler_is_refused_before_a_store_is_made(
    ground, capfd
):
    from distributed import LocalCluster

    out = ground.with_name("out")
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None,
        protocol="tcp://", memory_limit="300MB",
    ) as cluster:  # fmt: skip
        words = ["survey", "lsr1", str(ground), str(out)]
        assert main([*words, "--scheduler", cluster.scheduler_address]) == 2
    err = capfd.readouterr().err
    assert "a worker has 300 MB: give a smaller --chunk" in err and not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGHUP])
def test_a_survey_that_is_told_to_end_does_so_without_noise(ground, how):
    out = ground.with_name("out")
    process = start_command("survey", "lsr1", ground, out, *LONG, "--workers", 1)
    try:
        wait_for_chunks(out, 1)
        process.send_signal(how)
        _, err = process.communicate(timeout=200)
    finally:
        process.kill()
    assert (process.returncode, err) == (130, "")


@pytest.mark.slow
def test_a_scheduler_that_dies_is_one_line_and_what_is_finished_stays(ground):
    out = ground.with_name("out")
    scheduler_file = ground.with_name("scheduler.json")
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
        process = start_command("survey", "lsr1", ground, out, *LONG, "--scheduler", address)
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
def test_a_scheduler_without_workers_is_refused_after_a_while(ground, monkeypatch):
    monkeypatch.setattr(checks, "WORKERS_TIME", 0.3)
    prepared = prepare_survey(make_request(), str(ground), ground.with_name("out"), 64)
    scheduler_file = ground.with_name("scheduler.json")
    scheduler = start_dask("dask_scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard",
                           "--scheduler-file", scheduler_file)  # fmt: skip
    try:
        wait_until(
            lambda: scheduler_file.exists() and scheduler_file.stat().st_size, "a scheduler", 120.0
        )
        address = scheduler_file.read_text().split('"address": "')[1].split('"')[0]
        with pytest.raises(PlanningError, match=r"has had no worker for 0\.3 s; start some"):
            run_survey(prepared.job, prepared.chunks, ClusterSettings(address))
    finally:
        scheduler.kill()
        scheduler.wait(timeout=30)


@pytest.mark.slow
def test_dask_at_rest_looks_around_once_a_second(ground):
    """At 50 times a second, each of its servers takes a percent of a core."""
    with open_client(ClusterSettings(workers=1)) as client:

        def find_period(dask_worker) -> float:
            return dask_worker.periodic_callbacks["tick"].callback_time

        def find_scheduler_period(dask_scheduler) -> float:
            return dask_scheduler.periodic_callbacks["tick"].callback_time

        assert set(client.run(find_period).values()) == {1000.0}
        assert client.run_on_scheduler(find_scheduler_period) == 1000.0


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
@pytest.mark.parametrize("most", [100, 5_000, 12_000, 14_000])
def test_no_space_for_a_layer_is_one_line_and_leaves_nothing(tmp_path, most):
    """The size of files is limited, as a full disk cannot be had without rights."""
    pytest.importorskip("rasterio", reason="install the extra survey")
    survey_here(tmp_path, make_rough_map(130, 130), make_request())

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

    words = [sys.executable, "-m", "rover_planner", "survey", "lsr1", str(tmp_path / "map.npz"),
             str(tmp_path / "out"), "--headings", "4",
             "--geotiff", str(tmp_path / "layers")]  # fmt: skip
    ended = subprocess.run(words, capture_output=True, text=True, timeout=120, preexec_fn=limit)
    assert ended.returncode == 2, ended.stderr
    assert ".tif: cannot be written: File too large" in ended.stderr
    assert ended.stderr.count("\n") == 1
    rasterio = pytest.importorskip("rasterio")
    for path in (tmp_path / "layers").iterdir():  # what is there is whole
        with rasterio.open(path) as layer:
            layer.read()


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
