# SPDX-License-Identifier: Apache-2.0
"""The demo shows real answers over DDS, writes its picture and leaves nothing running."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

from rover_physics import save_terrain
from rover_planner.cli import main
from rover_planner.demo import demo as demo_module
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.command_line import assert_refused
from support.grounds import make_terrain, raised
from support.project.checkout import TOP
from support.project.processes import ProcessToken
from support.rovers import LSR1
from support.waiting import wait_until

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("matplotlib", reason="needs matplotlib")


@pytest.fixture
def map_file(tmp_path):
    """A small terrain of gentle ground with a corner that was never seen."""
    made = make_mars_terrain(4, 6.0, 0.1, rock_cover=0.0, crater_density=0.0)
    path = tmp_path / "map.npz"
    save_terrain(path, raised(made, np.s_[40:, 40:], np.nan))
    return path


@pytest.fixture
def token(monkeypatch):
    """Return what all processes are known by that a test starts."""
    made = ProcessToken()
    for name, value in made.environment.items():
        monkeypatch.setenv(name, value)
    return made


def test_the_picture_shows_the_path_that_a_server_searches_where_all_candidates_fail():
    ground = make_terrain(lambda x, y: 1.0 * ((np.abs(x) < 0.15) & (np.abs(y) < 2.5)), 0.1)
    answer = demo_module.answer_as_a_server(LSR1, ground, (-2.5, 0.0, 0.0), (2.5, 0.0, 0.0))
    assert answer.traversable and np.abs(answer.chosen.poses[:, 1]).max() > 2.5


@pytest.mark.slow
def test_demo_prints_answers_and_writes_a_picture(tmp_path, map_file, token, capsys):
    picture = tmp_path / "made" / "demo.png"
    assert main(["demo", "--map", str(map_file), "--out", str(picture)]) == 0
    out, err = capsys.readouterr()
    assert err == "" and "compile" in out and "publish the map" in out and "[m]" in out
    rows = [line for line in out.splitlines() if line.startswith("│")]
    plain = [row for row in rows if " plain " in row]
    assert any("traversable" in row for row in plain)
    assert "refused" in next(row for row in rows if " off the map " in row)
    assert "refused" in next(row for row in rows if " unknown ground " in row)
    goals = sum("traversable" in row or "refused" in row for row in rows)
    assert f"{goals} of {goals} verdicts" in out
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 50_000
    assert token.wait_until_gone() == []


@pytest.mark.long
def test_a_server_that_dies_fails_the_demo_with_one_line(tmp_path, map_file, token, capsys):
    def kill_the_server():
        server = "rover_planner.nodes.traverse_server"
        os.kill(wait_until(lambda: token.find(server), server, 240.0)[0], signal.SIGKILL)

    threading.Thread(target=kill_the_server).start()
    assert main(["demo", "--map", str(map_file), "--out", str(tmp_path / "demo.png")]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "traverse_server" in err
    assert token.wait_until_gone() == []


@pytest.mark.long
def test_goals_that_a_busy_server_has_no_time_for_are_refused_in_the_table(
    tmp_path, map_file, monkeypatch, capsys
):
    """The demo ended with "it said nothing"."""
    usual = demo_module._server_parameters
    busy = "-p", "time_budget:=0.05", "-p", "candidate_count:=99"
    monkeypatch.setattr(demo_module, "_server_parameters", lambda *words: (*usual(*words), *busy))
    answers = demo_module.run_demo(str(map_file), tmp_path / "demo.png")
    refused = [answer["code"] for answer in answers if not answer["traversable"]]
    assert "too_long" in refused
    assert capsys.readouterr().out.count("│ refused") == len(refused)


@pytest.mark.long
def test_the_kernels_are_compiled_before_the_server_starts(tmp_path):
    """The step that says so did nothing once its module had moved; the server compiled then."""
    environment = os.environ | {"PYTHONPATH": str(TOP), "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", demo_module.COMPILER]
    with subprocess.Popen(command, env=environment) as compiler:
        wait_until(lambda: list(tmp_path.rglob("*.nbc")), "a kernel", 240.0)
        compiler.kill()  # it would go on for more than a minute


@pytest.mark.parametrize("out", ["picture.txt", "map.npz/demo.png"])
def test_a_picture_that_cannot_be_written_is_refused_with_one_line(tmp_path, map_file, capfd, out):
    code = main(["demo", "--map", str(map_file), "--out", str(tmp_path / out)])
    assert_refused(capfd, code, "picture")
