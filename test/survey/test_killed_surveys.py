# SPDX-License-Identifier: Apache-2.0
"""Nothing of a survey is lost and no process is left, whatever is killed."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="install the extra survey")

from rover_planner.shell.run_program import END_SIGNALS
from rover_planner.survey.dask_cluster import ClusterSettings, open_client
from rover_planner.survey.runner import run_survey
from rover_planner.survey.store import SurveyStore
from support.project.checkout import TOP
from support.survey_maps import (
    assert_same_bits,
    die_on_one,
    layers_of,
    make_request,
    make_rough_map,
    prepare_here,
    survey_here,
)
from support.waiting import wait_until, wait_until_gone

pytestmark = pytest.mark.long

SIDE = 180
"""Cells of a side of the map; it has 9 chunks."""
SHARED = ("--headings", 4, "--chunk", 64, "--workers", 2)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a map, and the layers that this process finds on it in one chunk."""
    folder = tmp_path_factory.mktemp("survey")
    prepared = survey_here(folder, make_rough_map(SIDE, SIDE), make_request(), chunk=192)
    return folder / "map.npz", layers_of(prepared.store)


def start(module, *words) -> subprocess.Popen:
    """Start a module of Python in a process of its own, as from a terminal."""

    def heed_signals() -> None:  # that a program under nohup ignores
        for one in END_SIGNALS:
            signal.signal(one, signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, words)],
        env=os.environ | {"PYTHONPATH": str(TOP)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed_signals,
    )  # fmt: skip


def wait_for_a_chunk(out: Path) -> None:
    wait_until(lambda: out.exists() and SurveyStore(out).find_finished(), "a chunk", 300.0)


def children_of(pid) -> list[int]:
    """Return the worker processes of a command."""
    children = (path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))
    return [
        int(child)
        for child in " ".join(children).split()
        if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()
    ]


@pytest.mark.parametrize(
    "how", [signal.SIGINT, signal.SIGKILL, signal.SIGTERM, signal.SIGHUP], ids=lambda how: how.name
)
def test_a_killed_command_leaves_no_worker_and_goes_on_where_it_was(whole, tmp_path, how):
    map_file, layers = whole
    out = tmp_path / "out"
    words = ("rover_planner", "survey", "lsr1", map_file, out, *SHARED)
    process = start(*words)
    try:
        wait_for_a_chunk(out)
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
    done = len(SurveyStore(out).find_finished())
    assert 1 <= done < 9
    again = start(*words)
    printed, err = again.communicate(timeout=200)
    assert (again.returncode, err) == (0, "")
    report = json.loads(printed)
    assert report["chunks_found"] == done and report["chunks_done"] == 9 - done
    assert_same_bits(layers_of(SurveyStore(out)), layers)


def test_workers_do_not_see_ctrl_c_which_a_terminal_sends_to_all():
    def blocks_ctrl_c() -> bool:  # sent by its code
        import signal

        return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())

    with open_client(ClusterSettings(workers=2)) as client:
        assert list(client.run(blocks_ctrl_c).values()) == [True, True]
    assert not blocks_ctrl_c()


def test_a_chunk_of_which_workers_die_is_named_and_the_rest_stands(tmp_path):
    prepared = prepare_here(tmp_path, make_rough_map(120, 120), make_request(), chunk=64)
    settings = ClusterSettings(workers=1)
    outcome = run_survey(prepared.job, prepared.chunks, settings, task=die_on_one)
    assert outcome.failed == {(0, 1): "its worker died 3 times"} and outcome.done == 3


def test_a_scheduler_that_dies_is_one_line_and_what_is_finished_stays(whole, tmp_path):
    out, place = tmp_path / "out", tmp_path / "scheduler.json"
    dask = "distributed.cli.dask_"
    started = [start(f"{dask}scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard",
                     "--scheduler-file", place)]  # fmt: skip
    try:
        wait_until(lambda: place.exists() and place.stat().st_size, "a scheduler", 120.0)
        started.append(start(f"{dask}worker", "--scheduler-file", place, "--nthreads", 1,
                             "--no-dashboard", "--no-nanny"))  # fmt: skip
        address = json.loads(place.read_text())["address"]
        started.append(start("rover_planner", "survey", "lsr1", whole[0], out, "--headings", 16,
                             "--chunk", 64, "--scheduler", address))  # fmt: skip
        wait_for_a_chunk(out)
        started[0].kill()
        _, err = started[2].communicate(timeout=200)
    finally:
        for one in started:
            one.kill()
            one.wait(timeout=30)
    assert started[2].returncode == 2, err
    assert "the scheduler is gone; finished chunks are kept" in err and err.count("\n") == 1, err
    assert SurveyStore(out).find_finished()
