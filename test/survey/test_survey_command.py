"""The command survey in processes: same bits however it runs, and nothing lost however it ends."""

import os
import resource
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("distributed", reason="install the extra survey")

from rover_physics.terrain.grid import save_terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.cluster import client as cluster_client
from rover_planner.survey.cluster.checks import check_workers
from rover_planner.survey.cluster.client import ClusterSettings, open_client
from rover_planner.survey.cluster.runner import run_survey
from rover_planner.survey.store import SurveyStore
from rover_planner.survey.survey import prepare_survey
from support.survey_maps import (
    assert_same_bits,
    count_chunks,
    die_on_one,
    fail_on_one,
    finish,
    forget_package,
    make_request,
    make_rough_map,
    start_command,
    survey_here,
    wait_for_chunks,
)
from support.waiting import wait_until_gone

SHARED = ("--headings", 4, "--chunk", 64)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the folder with the map, and the layers that one process finds on it in one chunk."""
    folder = tmp_path_factory.mktemp("survey")
    prepared = survey_here(folder / "here", make_rough_map(300, 300), make_request(), chunk=320)
    save_terrain(folder / "map.npz", make_rough_map(300, 300))
    return folder, layers_in(prepared.store.path)


def layers_in(path) -> dict[str, np.ndarray]:
    store = SurveyStore(path)
    return {name: store.layer(name)[:] for name in store.layer_names()}


def children_of(pid) -> list[int]:
    """Return the worker processes of a command."""
    found = []
    children = (path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))
    for child in " ".join(children).split():
        words = Path(f"/proc/{child}/cmdline").read_bytes()
        if b"spawn_main" in words:
            found.append(int(child))
    return found


@pytest.mark.slow
def test_two_workers_find_what_one_process_finds(whole, tmp_path):
    folder, layers = whole
    out, picture = tmp_path / "out", tmp_path / "p.png"
    code, report, err = finish(
        start_command("survey", "lsr1", folder / "map.npz", out, *SHARED, "--workers", 2,
                      "--picture", picture)
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert report["chunks"] == report["chunks_done"] == 25 and report["chunks_failed"] == []
    assert report["poses"] == 300 * 300 * 4 and report["surveyed"] == 90_000
    assert sum(report["best_class"].values()) == pytest.approx(1.0, abs=1e-5)
    assert picture.stat().st_size > 10_000
    assert_same_bits(layers_in(out), layers)
    code, again, err = finish(
        start_command("survey", "lsr1", folder / "map.npz", out, *SHARED[:2])
    )
    assert (code, err) == (0, "") and again["chunks_done"] == 0 and again["chunks_found"] == 25


@pytest.mark.slow
def test_a_killed_worker_costs_only_its_chunks_time(whole, tmp_path):
    folder, layers = whole
    out = tmp_path / "out"
    process = start_command("survey", "lsr1", folder / "map.npz", out, *SHARED, "--workers", 2)
    try:
        wait_for_chunks(out, 2)
        victim = children_of(process.pid)[0]
        os.kill(victim, signal.SIGKILL)
        code, report, err = finish(process)
    finally:
        process.kill()
    assert (code, err) == (0, "") and report["chunks_done"] == 25
    assert_same_bits(layers_in(out), layers)


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", [signal.SIGKILL, signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_a_killed_command_leaves_no_worker_and_goes_on_where_it_was(whole, tmp_path, how):
    folder, layers = whole
    out = tmp_path / "out"
    words = ("survey", "lsr1", folder / "map.npz", out, *SHARED, "--workers", 2)
    process = start_command(*words)
    try:
        wait_for_chunks(out, 3)
        workers = children_of(process.pid)
        assert len(workers) == 2
        process.send_signal(how)
        _, err = process.communicate(timeout=200)
    finally:
        process.kill()
    if how == signal.SIGINT:
        assert (process.returncode, err) == (130, "")
    for worker in workers:
        wait_until_gone(worker, 30.0)
    done = count_chunks(out)
    assert 3 <= done < 25
    code, report, err = finish(start_command(*words))
    assert (code, err) == (0, "")
    assert report["chunks_found"] == done and report["chunks_done"] == 25 - done
    assert_same_bits(layers_in(out), layers)


@pytest.mark.slow
def test_an_existing_scheduler_does_the_work(whole, tmp_path):
    from distributed import LocalCluster

    folder, layers = whole
    with LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None,
        protocol="tcp://",
    ) as cluster:  # fmt: skip
        words = ["survey", "lsr1", str(folder / "map.npz"), str(tmp_path / "out")]
        words += [*map(str, SHARED), "--scheduler", cluster.scheduler_address]
        assert main(words) == 0
    assert_same_bits(layers_in(tmp_path / "out"), layers)


@pytest.mark.slow
def test_no_space_left_is_one_line_and_nothing_is_lost(whole, tmp_path):
    """The size of files is limited, as a full disk cannot be had without rights."""
    folder, layers = whole
    out = tmp_path / "out"
    prepare_survey(make_request(), str(folder / "map.npz"), out, 64)

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1500, resource.RLIM_INFINITY))

    words = [sys.executable, "-m", "rover_planner", "survey", "lsr1", str(folder / "map.npz"),
             str(out), *map(str, SHARED), "--workers", "2"]  # fmt: skip
    ended = subprocess.run(words, capture_output=True, text=True, timeout=120, preexec_fn=limit)
    assert ended.returncode == 2, ended.stderr
    assert "cannot be written: File too large; finished chunks are kept" in ended.stderr
    assert ended.stderr.count("\n") == 1
    code, report, err = finish(start_command(*words[3:]))
    assert (code, err) == (0, "") and report["surveyed"] == 90_000
    assert_same_bits(layers_in(out), layers)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "why"),
    [(fail_on_one, "RuntimeError: this chunk is cursed"), (die_on_one, "its worker died 3 times")],
)
def test_a_chunk_that_fails_three_times_is_named_and_the_rest_stands(tmp_path, task, why):
    save_terrain(tmp_path / "map.npz", make_rough_map(120, 120))
    prepared = prepare_survey(make_request(), str(tmp_path / "map.npz"), tmp_path / "out", 64)
    outcome = run_survey(prepared.job, prepared.chunks, ClusterSettings(workers=1), task=task)
    assert outcome.failed == {(0, 1): why} and outcome.done == 3
    again = prepare_survey(make_request(), str(tmp_path / "map.npz"), tmp_path / "out")
    assert again.chunks == [(0, 1)]
    cells = again.job.layout.cells_of((0, 1))
    assert (again.store.layer("best_class")[cells] == 255).all()
    assert (again.store.layer("best_class")[:] == 255).sum() == 64 * 56


@pytest.mark.slow
def test_workers_of_another_version_or_place_are_refused(tmp_path):
    save_terrain(tmp_path / "map.npz", make_rough_map(30, 30))
    job = prepare_survey(make_request(), str(tmp_path / "map.npz"), tmp_path / "out").job
    elsewhere = tmp_path / "elsewhere"
    with open_client(ClusterSettings(workers=1)) as client:
        check_workers(job, client)
        with pytest.raises(PlanningError, match=r"worker tcp://.* has version .*, not 99\.0"):
            check_workers(replace(job, version="99.0"), client)
        with pytest.raises(PlanningError, match=f"does not see {elsewhere}"):
            check_workers(replace(job, store=elsewhere), client)
        client.run(forget_package)
        with pytest.raises(PlanningError, match="cannot import rover_planner: "):
            check_workers(job, client)


@pytest.mark.slow
def test_failed_chunks_are_exit_code_1(tmp_path, monkeypatch, capfd):
    """The map is a tif whose height is beyond anything plausible in one place."""
    rasterio = pytest.importorskip("rasterio")
    heights = np.zeros((130, 130), np.float32)
    heights[5, 5] = 1e30
    with rasterio.open(
        tmp_path / "map.tif", "w", driver="GTiff", width=130, height=130, count=1,
        dtype="float32", crs="EPSG:32633",
        transform=rasterio.Affine(0.1, 0, 5e5, 0, -0.1, 5e6),
    ) as file:  # fmt: skip
        file.write(heights, 1)
    words = ["survey", "lsr1", str(tmp_path / "map.tif"), str(tmp_path / "out"), "--workers", "1"]
    assert main([*words, *map(str, SHARED)]) == 1
    err = capfd.readouterr().err
    assert "chunks [1, 0], [2, 0] failed: TerrainError: elevation[" in err, err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--headings", "65"], "headings is 65; it must be 1 to 64"),
        (["--step", "0"], "step is 0"),
        (["--policy", "magic"], "no torque policy 'magic'"),
        (["--friction", "-1"], "friction is -1.0"),
        (["--memory-limit", "lots"], "memory limit is 'lots'; it must be a size such as 1GiB"),
        (["--scheduler", "elsewhere"], "scheduler is 'elsewhere'; it must be an address"),
        (["--scheduler", "tcp://127.0.0.1:9"], "no scheduler at tcp://127.0.0.1:9"),
        (["--chunk", "-5"], "chunk is -5"),
        (["--max-cells", "99"], "the limit is 99"),
        (["--workers", "0"], "--workers"),
        (["--sigmas", "nan"], "sigmas"),
        (["--max-gap", "-1"], "max_gap is -1.0"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, monkeypatch, words, said, capfd):
    monkeypatch.setattr(cluster_client, "CONNECT_TIME", 0.5)
    save_terrain(tmp_path / "map.npz", make_rough_map(30, 30))
    out = tmp_path / "out"
    assert main(["survey", "lsr1", str(tmp_path / "map.npz"), str(out), *words]) == 2
    err = capfd.readouterr().err
    assert said in err and err.count("\n") == 1 and not out.exists()


@pytest.mark.slow
def test_a_chunk_beyond_the_memory_of_a_worker_is_refused(tmp_path, capfd):
    save_terrain(tmp_path / "map.npz", make_rough_map(130, 130))
    words = ["survey", "lsr1", str(tmp_path / "map.npz"), str(tmp_path / "out")]
    assert main([*words, "--memory-limit", "300MB", "--workers", "1"]) == 2
    err = capfd.readouterr().err
    assert "a worker has 300 MB: give a smaller --chunk or more memory" in err
    assert err.count("\n") == 1
