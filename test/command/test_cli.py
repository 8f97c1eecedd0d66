# SPDX-License-Identifier: Apache-2.0
"""The command line: help, poses, some commands; bad input is exit code 2 and one short line."""

import json
import os

import numpy as np
import pytest
import typer

import rover_physics
from rover_physics import load_rover, load_terrain, save_terrain
from rover_planner.cli import app, main
from rover_planner.shell.poses import join_poses
from support.command_line import assert_refused, write_ground_and_path
from support.grounds import make_terrain, wall_with_gap

COMMANDS = typer.main.get_command(app).commands


def test_terrain_says_what_it_wrote_with_control_characters_of_a_name_escaped(
    tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    assert main(["terrain", "\udcff.npz", "--size", "4", "--resolution", "0.1"]) == 0
    columns = load_terrain("\udcff.npz").elevation.shape[1]
    told = f"wrote \\udcff.npz: {columns} x {columns} cells of 0.1 m, 100 % known\n"
    assert capfd.readouterr().out == told


def test_the_version_is_printed(capfd):
    assert main(["--version"]) == 0
    assert capfd.readouterr().out == f"rover_planner {rover_physics.__version__}\n"


def test_help_is_exit_code_0_and_tells_of_each_option(capfd):
    assert main(["--help"]) == 0
    listed = capfd.readouterr().out
    for name, command in COMMANDS.items():
        assert name in listed
        assert main([name, "--help"]) == 0
        assert f"rover_planner {name}" in capfd.readouterr().out
        options = [one for one in command.params if one.param_type_name == "option"]
        assert [one.name for one in options if not one.help] == []


def params_of(name, *words):
    """Return what the parser of a command makes of words, without running the command."""
    return COMMANDS[name].make_context(name, list(words)).params


FORMS = (
    ["--start", "-3,-.5,1e-1"],
    ["--start=-3,-.5,1e-1"],
    ["--start", "-3", "-.5", "1e-1"],
    ["--start=-3", "-.5", "1e-1"],
    ["--start", "-3 -.5 1e-1"],
    ["--start", "-3,", "-.5,", "1e-1"],
)
"""The same pose."""


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "words",
    [
        ["plan", "lsr1", "a", "b", "--goal", "1", "2", "3"],
        ["view", "lsr1", "spirit", "--goal=1,2,3"],
        ["replay", "bag", "out", "--goal", "1,2,3"],
    ],
)
def test_each_command_takes_poses_with_commas_and_with_blanks(words, form):
    params = params_of(*words, *form)
    assert params["start"] == (-3.0, -0.5, 0.1) and params["goal"] == (1.0, 2.0, 3.0)


def test_words_behind_a_pose_are_left_to_the_command():
    params = params_of("plan", "--goal", "1", "2", "3", "--start", "1,2,3", "lsr1", "5", "6")
    assert params["terrain"] == "5" and str(params["out"]) == "6"
    for place in (["-3,-0.5"], ["-3", "-0.5"]):
        assert params_of("reachable", "s.zarr", "--from", *place)["start"] == "-3,-0.5"
    assert join_poses(["--start", "1,2", "x"]) == ["--start=1,2", "x"]
    assert join_poses(["--", "--start", "1", "2", "3"]) == ["--", "--start", "1", "2", "3"]
    assert join_poses(["--start"]) == ["--start"]


def test_a_preset_goes_to_urdf_and_back(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["urdf", "lsr1", "lsr1.urdf", "--map", "joints.yaml"]) == 0
    words = ["rover", "--from-urdf", "lsr1.urdf", "--map", "joints.yaml", "again.yaml"]
    assert main(words) == 0
    told = "wrote again.yaml: lsr1, 8.3 kg, left and right differ by 0 mm"
    assert told in capsys.readouterr().out
    assert load_rover("again.yaml") == load_rover("lsr1")


def test_reach_answers_in_json_whatever_the_answer(capfd, tmp_path):
    write_ground_and_path(tmp_path)

    def ask_reach(*words):
        assert main(["reach", "lsr1", str(tmp_path / "terrain.npz"), "2,2,0.5", *words]) == 0
        return json.loads(capfd.readouterr().out)

    answer = ask_reach("2.5,2.3,0.3")
    assert answer["possible"] and answer["reachable"] and answer["code"] == ""
    assert set(answer["joint_angles"]) == {"arm_yaw", "arm_shoulder", "arm_elbow"}
    pushed = ask_reach("2.5,2.3,0.3", "--force", "0", "0", "-10", "--payload", "0")
    assert sum(pushed["wheel_loads"]) == pytest.approx(sum(answer["wheel_loads"]) + 10.0)
    answer = ask_reach("-3.5,2.0,0.3")
    assert not answer["possible"] and answer["code"] == "too_far" and answer["out_of_reach"] > 4.0


ENDS = ("--start=-1.2,0.5,0", "--goal=1.2,0.5,0")


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """Return a terrain file with a wall that is open at one end."""
    path = tmp_path_factory.mktemp("plan") / "ground.npz"
    save_terrain(path, make_terrain(wall_with_gap, half=2.6))
    return path


def test_a_way_is_written_with_its_predictions_and_predict_passes_it(ground, tmp_path, capfd):
    out, picture, dump = (tmp_path / name for name in ("way.npz", "way.png", "asked.npz"))
    words = ["plan", "lsr1", str(ground), str(out), *ENDS, "--budget=60", "--friction=0.7"]
    assert main([*words, "--picture", str(picture), "--dump", str(dump)]) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["found"] is True and report["reason"] == ""
    for name in ("length", "energy", "time", "risk", "seconds_first", "seconds", "bound"):
        assert report[name] > 0.0
    assert 0 < report["edges_judged"] < report["edges"] and report["expanded"] > 0
    with np.load(out) as way:
        poses = way["poses"]
        assert bool(way["traversable"]) and way["wheel_loads"].shape == (len(poses), 6)
    assert picture.stat().st_size > 10_000
    words = ["predict", "lsr1", str(ground), str(out), str(tmp_path / "p.npz"), "--friction=0.7"]
    assert main(words) == 0
    assert "waypoints, traversable" in capfd.readouterr().out
    assert main(["replay-plan", str(dump), str(tmp_path / "again.npz")]) == 0
    again = json.loads(capfd.readouterr().out)
    assert again["cost"] == report["cost"] and again["repeatable"] is True
    with np.load(tmp_path / "again.npz") as way:
        np.testing.assert_array_equal(way["poses"], poses)


def test_without_a_way_no_file_is_written_and_the_reason_is_told(ground, tmp_path, capfd):
    out = tmp_path / "way.npz"
    words = ["plan", "lsr1", str(ground), str(out), ENDS[0], "--goal=0,0,0"]
    assert main(words) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["found"] is False and report["outcome"] == "goal_refused"
    assert "cannot stand at the goal" in report["reason"] and report["length"] is None
    assert not out.exists()


# Bad input

DIGITS = "9" * 400


AHEAD = ["--start=1,2,0", "--goal=3,2,0"]
PREDICT = ["predict", "lsr1", "terrain.npz", "poses.npz", "out.npz"]
VIEW = ["view", "lsr1", "terrain.npz", "--port", "0"]
REFUSED = [
    ([], "command"),
    (["dance"], "dance"),
    ([*PREDICT, "--tool-force", "0", "1"], "tool-force"),
    ([*PREDICT, "--arm", "arm_yaw=nan"], "NAME=RAD"),
    ([*PREDICT, "--arm", "arm_yaw=0.1"], "lacks arm_shoulder, arm_elbow"),
    ([*PREDICT, "--arm", "arm_yaw=0.1", "--arm", "arm_yaw=0.2"], "twice"),
    (["reach", "lsr1", "terrain.npz", "here", "2", "0.5", "2.5", "2.3", "0.3"], "'X'"),
    (["plan", "lsr1", "terrain.npz", "o.npz", "--start=1,2", "--goal=1,0,0"], "'1,2' is no pose"),
    (["replay-plan", "terrain.npz", "o.npz"], "terrain.npz holds no question for a path"),
    (["predict", "lsr1", "terrain.npz", "poses.npz", "./poses.npz"], "poses.npz is named twice"),
    (["advise", "lsr1", "terrain.npz", "poses.npz", "terrain.npz"], "terrain.npz is named twice"),
    (["plan", "lsr1", "terrain.npz", "o.npz", *AHEAD, "--dump", "o.npz"], "o.npz is named twice"),
    (["replay-plan", "o.npz", "o.npz"], "o.npz is named twice"),
    (["learn", "lsr1", "terrain.npz", "a.csv", "a.csv"], "a.csv is named twice"),
    (["urdf", "a.yaml", "a.yaml"], "a.yaml is named twice"),
    (["rover", "a.yaml", "--from-urdf", "a.urdf", "--map", "a.yaml"], "a.yaml is named twice"),
    (["rover", "out.yaml"], "--from-urdf"),
    (["terrain", "t.npz", "--seed", DIGITS * 20], "--seed"),
    (["study", "\x1b[2J\n\udcff"], "no study file \\x1b[2J\\n\\udcff"),
    (["figure4", "."], "must be a .png, .svg, .pdf file"),
    ([*VIEW, "--port", "99999"], "'--port': Input should be less than or equal to 65535"),
    ([*VIEW, "--host", "9.1.1.1"], "host is '9.1.1.1'; it must be an address of this machine"),
    ([*VIEW, "--max-gap", "nan"], "max_gap is nan"),
    ([*VIEW, "--start", "nan", "0", "0"], "'nan,0,0' is no pose"),
    ([*VIEW, "--start", "-300", "0", "0"], "start is (-300, 0) m; it must be on the map"),
    ([*VIEW, "--goal", "1", "2e5", "0"], "goal is (1, 200000) m; it must be on the map"),
    ([*VIEW, "--survey", ".", "--follow"], "--follow and --survey exclude each other"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "names"), REFUSED, ids=["-".join(words)[:60] for words, _ in REFUSED]
)
def test_bad_input_is_refused_in_one_short_line(tmp_path, monkeypatch, capfd, words, names):
    monkeypatch.chdir(tmp_path)
    write_ground_and_path(tmp_path)
    if "view" in words:
        pytest.importorskip("viser", reason="needs viser")
    assert_refused(capfd, main(words), names)


def test_what_nobody_wants_may_all_go_to_the_null_device():
    assert main(["urdf", "lsr1", os.devnull, "--map", os.devnull]) == 0
