# SPDX-License-Identifier: Apache-2.0
"""The command line keeps its promise: bad input is exit code 2 and one line, whatever it is."""

import pytest

from rover_planner.cli import main
from rover_planner.shell.run_program import MAX_LINE
from support.command_line import write_ground_and_path

DIGITS = "9" * 400


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_ground_and_path(tmp_path)


def assert_one_short_line(capfd, words, names):
    code = main(words)
    line = capfd.readouterr().err
    assert code == 2, line
    assert line.startswith("rover_planner: ")
    assert line.count("\n") == 1 and len(line) <= MAX_LINE + 1
    assert line[:-1].isprintable() and "Traceback" not in line
    assert names in line


def predict(*more, rover="lsr1", terrain="terrain.npz", poses="poses.npz", out="out.npz"):
    return ["predict", rover, terrain, poses, out, *more]


REFUSED = [
    ([], "command"),
    (["dance"], "dance"),
    (["predict"], "ROVER"),
    (predict("--colour", "red"), "--colour"),
    (predict("--friction", "high"), "friction"),
    (predict("--tool-force", "0", "1"), "tool-force"),
    (predict("--arm", "arm_yaw=nan"), "NAME=RAD"),
    (predict("--arm", "arm_yaw=0.1"), "lacks arm_shoulder, arm_elbow"),
    (predict("--arm", "arm_yaw=0.1", "--arm", "arm_yaw=0.2"), "twice"),
    (["reach", "lsr1", "terrain.npz", "here", "2", "0.5", "2.5", "2.3", "0.3"], "'X'"),
    (["plan", "lsr1", "terrain.npz", "o.npz", "--start=1,2", "--goal=1,0,0"], "'1,2' is no pose"),
    (["replay-plan", "terrain.npz", "o.npz"], "terrain.npz holds no question for a path"),
    (["rover", "out.yaml"], "--from-urdf"),
    (["terrain", "t.npz", "--seed", DIGITS * 20], "--seed"),
    (["study", "\x1b[2J\n\udcff"], "no study file \\x1b[2J\\n\\udcff"),
    (["figure4", "."], "must be a .png, .svg, .pdf file"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "names"), REFUSED, ids=["-".join(words)[:40] for words, _ in REFUSED]
)
def test_bad_input_is_refused_in_one_short_line(files, capfd, words, names):
    assert_one_short_line(capfd, words, names)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["--port", "99999"], "port is 99999; it must be 0 to 65535"),
        (["--host", "999.1.1.1"], "host is '999.1.1.1'; it must be an address of this machine"),
        (["--max-gap", "nan"], "max_gap is nan"),
        (["--start", "nan", "0", "0"], "'nan,0,0' is no pose"),
        (["--start", "-300", "0", "0"], "start is (-300, 0) m; it must be on the map"),
        (["--goal", "1", "2e5", "0"], "goal is (1, 200000) m; it must be on the map"),
    ],
)
def test_view_refuses_what_it_cannot_serve_instead_of_waiting(files, capfd, words, names):
    pytest.importorskip("viser", reason="needs viser")
    assert_one_short_line(capfd, ["view", "lsr1", "terrain.npz", "--port", "0", *words], names)


def test_names_with_control_characters_are_shown_escaped(files, capfd):
    assert main(["terrain", "\udcff.npz", "--size", "2"]) == 0
    assert capfd.readouterr().out.startswith("wrote \\udcff.npz: ")
