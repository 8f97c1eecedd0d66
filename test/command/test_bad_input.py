"""The command line keeps its promise: bad input is exit code 2 and one line, whatever it is."""

import os
import signal
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest

from benchmarks.fuzz_files import fuzz_files
from rover_physics.warm_up import warm_up
from rover_planner.cli import main
from rover_planner.shell.exit_codes import EXIT_INTERRUPTED
from rover_planner.shell.one_line import MAX_LINE
from support.command_line import REPOSITORY, predict_words, write_ground_and_path

LONG = "n" * 300
DIGITS = "9" * 400


@pytest.fixture
def files(tmp_path, monkeypatch):
    warm_up()  # not part of the times below
    monkeypatch.chdir(tmp_path)
    return write_ground_and_path(tmp_path)


def assert_one_short_line(capfd, words, names, most=60.0):
    began = time.perf_counter()
    code = main(words)
    took = time.perf_counter() - began
    line = capfd.readouterr().err
    assert code == 2, line
    assert line.count("\n") == 1 and len(line) <= MAX_LINE + 1
    assert line[:-1].isprintable()
    assert names in line
    assert took < most


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["predict", LONG, "t", "p", "o"], "no rover 'nnn"),
        (["predict", "lsr1", LONG, "p", "o"], "no terrain 'nnn"),
        (["predict", "lsr1", "terrain.npz", LONG, "o"], "cannot be read: File name too long"),
        (["predict", "lsr1", "terrain.npz", "poses.npz", LONG], "cannot be written: File name"),
        (["predict", "lsr1", "terrain.npz", "poses.npz", "/dev/full"], "No space left on device"),
        (["predict", "lsr1", "/dev/zero", "poses.npz", "out.npz"], "it is a device"),
        (["predict", "lsr1", "terrain.npz", "poses.npz", "o", "--max-cells", "99"], "limit is"),
        (["predict", "lsr1", "terrain.npz", "poses.npz", "o", "--max-cells", "1"], "--max-cells"),
        (["reach", "lsr1", "terrain.npz", "1", "2", "0", "1", "2", "0", "--max-cells", "99"],
         "elevation has 80 x 120 cells; the limit is 99"),
        (["terrain", LONG, "--size", "2"], "cannot be written: File name too long"),
        (["terrain", "t.npz", "--craters", "1e12"], "crater density is 1000000000000.0 1/m^2"),
        (["terrain", "t.npz", "--size", "0.25"], "size is 0.25 x 0.25 m; it must be more"),
        (["terrain", "t.npz", "--size", "1e308", "--resolution", "1e307"], "at most 1e+06 m"),
        (["terrain", "t.npz", "--roughness", "1e308"], "at most 100.0 m"),
        (["terrain", "t.npz", "--seed", DIGITS * 20], "--seed"),
        (["terrain", "t.npz", "--seed", "-" + DIGITS], "seed is -999"),
        (["study", LONG], "no study file nnn"),
        (["study", "."], "it is a directory; it must be a regular file"),
        (["figure4", "."], "must be a .png, .svg, .pdf file"),
        (["figure4", LONG + ".png"], "File name too long"),
        (["figure4", "folder.png"], "Is a directory"),
    ],
    ids=lambda value: "-".join(value)[:40] if isinstance(value, list) else "",
)  # fmt: skip
def test_bad_input_is_refused_in_one_short_line(files, capfd, words, names):
    (files / "folder.png").mkdir()
    assert_one_short_line(capfd, words, names)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["--port", "99999"], "port is 99999; it must be 0 to 65535"),
        (["--port", "-1"], "port is -1"),
        (["--port", DIGITS], "port is 999"),
        (["--host", "999.1.1.1"], "host is '999.1.1.1'; it must be an address of this machine"),
        (["--host", "192.0.2.1"], "host is '192.0.2.1'"),
        (["--host", "a" * 300], "host is 'aaa"),
        (["--max-gap", "nan"], "max_gap is nan"),
        (["--port", "70000"], "port is 70000; it must be 0 to 65535"),
        (["--start", "-300", "0", "0"], "start is (-300, 0) m; it must be on the map"),
        (["--goal", "1", "2e5", "0"], "goal is (1, 200000) m; it must be on the map"),
    ],
)
def test_view_refuses_what_it_cannot_serve_instead_of_waiting(files, capfd, words, names):
    pytest.importorskip("viser", reason="needs viser")
    assert_one_short_line(capfd, ["view", "lsr1", "terrain.npz", "--port", "0", *words], names)


def test_view_refuses_a_start_that_is_no_number(files, capfd):
    pytest.importorskip("viser", reason="needs viser")
    words = ["view", "lsr1", "terrain.npz", "--port", "0", "--start", "nan", "0", "0"]
    assert_one_short_line(capfd, words, "'nan,0,0' is no pose")


DRIVE = """rover: lsr1
objective: worst_utilisation
parameters: [{name: friction, from: 0.5, to: 0.9, count: %s}]
drives: [{%s}]
"""


@pytest.mark.parametrize(
    ("count", "drive", "names"),
    [
        ("3", "slope: 0.1, length: 1.0e+9", "a drive is 1e+09 m long; it must be at most 4000 m"),
        ("3", "slope: 0.1, length: 1.0e+300", "a drive is 1e+300 m long"),
        ("3", "slope: 0.1, length: 1000.0", "a ground of 2e+03 m in cells of 0.02 m has"),
        ("3", "step: 0.1, start: [1.0e+300, 0.0, 0.0], file: x", "one of slope (rad), step"),
        ("3", "slope: 0.1, start: [1.0e+300, 0.0, 0.0]", "a ground of 2e+300 m"),
        ("3", "slope: 0.1, start: [1.0e+308, 1.0e+308, 0.0]", "a ground of inf m"),
        ("1000000", "slope: 0.1", "parameters[0].count is 1000000"),
    ],
)  # fmt: skip
def test_an_impossible_study_is_refused_in_one_short_line(files, capfd, count, drive, names):
    (files / "s.yaml").write_text(DRIVE % (count, drive))
    assert_one_short_line(capfd, ["study", "s.yaml"], names)


def test_a_study_of_endless_combinations_is_refused(files, capfd):
    numbers = ["wheel.radius", "wheel.width", "wheel.mass", "masses.body.mass"]
    entries = ", ".join(f"{{name: {name}, from: 0.5, to: 0.9, count: 1000}}" for name in numbers)
    (files / "s.yaml").write_text(
        f"rover: lsr1\nobjective: load_imbalance\nparameters: [{entries}]\n"
    )
    assert_one_short_line(capfd, ["study", "s.yaml"], "parameters have 1e+12 combinations")


def test_a_study_of_tiny_or_huge_wheels_ends(files, capfd):
    for low, high in (("1.0e-9", "1.0e-8"), ("1.0e+8", "1.0e+9")):
        entry = f"{{name: wheel.radius, from: {low}, to: {high}, count: 2}}"
        (files / "s.yaml").write_text(
            f"rover: lsr1\nobjective: tallest_step\nparameters: [{entry}]\n"
        )
        assert_one_short_line(capfd, ["study", "s.yaml"], "no rover of the study could be judged")


def replay_words(files):
    return ["view", "lsr1", str(files / "terrain.npz"), "--prediction", str(files / "bad.npz"),
            "--port", "0"]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"every": np.float64(1.0)}, "assumptions must be one text"),
        ({"roll": np.float64(1.0)}, "roll has shape (); it must be (30,)"),
        ({"poses": np.zeros(30)}, "poses has shape (30,); it must be (30, 3)"),
        ({"wheel_loads": np.zeros((29, 6))}, "wheel_loads has shape (29, 6)"),
        ({"roll": np.zeros(30, complex)}, "entry roll has elements of type <c16"),
        ({"settled": np.zeros(30)}, "settled is of type float64; it must hold bools"),
        ({"status": np.zeros(30)}, "status is of type float64; it must hold whole numbers"),
        ({"reason": np.zeros(30)}, "reason must be an array (n,) of texts"),
        ({"reason": np.array([], dtype=str)}, "reason must be an array (n,) of texts"),
        ({"reason": np.array([{}] * 30)}, "entry reason holds Python objects"),
        ({"position": np.full((30, 3), np.nan)}, "position has a value that is NaN or beyond"),
        ({"poses": np.full((30, 3), 1e308)}, "poses has a value that is NaN or beyond"),
    ],
)
def test_a_replay_file_of_other_shapes_or_types_is_refused(files, capfd, changes, names):
    pytest.importorskip("viser", reason="needs viser")
    assert main(predict_words(files)) == 0
    with np.load(files / "out.npz") as out:
        arrays = dict(out)
    if "every" in changes:
        changes = dict.fromkeys(arrays, changes["every"])
    np.savez(files / "bad.npz", **(arrays | changes))
    assert_one_short_line(capfd, replay_words(files), names)


@pytest.mark.parametrize(
    ("entry", "names"),
    [
        (b"no array", "entry poses is damaged"),
        (b"", "entry poses is damaged"),
        (b"\x93NUMPY\x01\x00\x05\x00(((((", "entry poses is damaged"),
    ],
)
def test_poses_that_are_no_array_are_refused(files, capfd, entry, names):
    with zipfile.ZipFile(files / "poses.npz", "w") as archive:
        archive.writestr("poses.npy", entry)
    assert_one_short_line(capfd, predict_words(files), names)


def test_names_with_control_characters_are_shown_escaped(files, capfd):
    assert_one_short_line(capfd, ["study", "\x1b[2J\n\udcff"], "no study file \\x1b[2J\\n\\udcff")
    assert main(["terrain", "\udcff.npz", "--size", "2"]) == 0
    assert capfd.readouterr().out.startswith("wrote \\udcff.npz: ")


def test_300_hostile_files_and_commands_are_taken_or_refused():
    fuzzer = fuzz_files(seed=1, count=300)
    assert fuzzer.defects == []
    assert sum(fuzzer.counts.values()) == 300
    assert len({kind for kind, _ in fuzzer.counts}) == 6


def test_ctrl_c_ends_a_command_without_a_traceback(files):
    (files / "s.yaml").write_text(DRIVE % ("1000", "slope: 0.1"))
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "rover_planner", "study", "s.yaml"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )  # fmt: skip
    assert process.stdout is not None
    process.stdout.readline()  # it has begun
    process.send_signal(signal.SIGINT)
    try:
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == EXIT_INTERRUPTED
    assert err == ""
