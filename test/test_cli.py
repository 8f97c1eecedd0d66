"""The command keeps its contract: arrays out, exit code 0, or exit code 2 and one line."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_physics.terrain import Terrain, load_terrain, save_terrain
from rover_planner.cli import main

REPOSITORY = Path(__file__).resolve().parent.parent
N = 30

SHAPES = {
    "settled": (N,),
    "position": (N, 3),
    "roll": (N,),
    "pitch": (N,),
    "rocker_angle": (N, 2),
    "bogie_angle": (N, 2),
    "wheel_centres": (N, 6, 3),
    "wheel_loads": (N, 6),
    "tangential": (N, 6),
    "lateral": (N, 6),
    "friction_utilisation": (N, 6),
    "slip_ratio": (N, 6),
    "torque_saturation": (N, 6),
    "tip_over_ratio": (N,),
    "tip_over_force_angle": (N,),
    "belly_clearance": (N,),
    "energy": (N,),
    "time": (N,),
    "reason": (N,),
    "traversable": (),
    "first_failure": (),
}


@pytest.fixture
def files(tmp_path):
    """A flat terrain with a hole, and a path that ends before it, in files."""
    elevation = np.zeros((80, 120))
    elevation[:, 100:] = np.nan
    save_terrain(tmp_path / "terrain.npz", Terrain(elevation, 0.05, (0.0, 0.0)))
    poses = np.column_stack([np.linspace(1, 3, N), np.full(N, 2.0), np.zeros(N)])
    np.savez(tmp_path / "poses.npz", poses=poses)
    return tmp_path


def arguments(folder, rover="lsr1", terrain="terrain.npz", poses="poses.npz", out="out.npz"):
    return ["predict", str(rover), *(str(folder / name) for name in (terrain, poses, out))]


def run(*words, cwd=REPOSITORY):
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    return subprocess.run(
        [sys.executable, "-m", "rover_planner", *words],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )


def assert_refused(capfd, code, word):
    err = capfd.readouterr().err
    assert code == 2
    assert err.count("\n") == 1
    assert err.startswith("rover_planner: ")
    assert word in err
    assert "Traceback" not in err


def test_prediction_has_every_array_of_the_contract(files):
    result = run(*arguments(files))
    assert (result.returncode, result.stderr, result.stdout) == (0, "", "")
    with np.load(files / "out.npz", allow_pickle=False) as out:
        assert {name: out[name].shape for name in out.files} == SHAPES
        assert out["settled"].dtype == bool
        assert out["traversable"].dtype == bool
        assert bool(out["traversable"])
        assert out["first_failure"].dtype.kind == "i"
        assert int(out["first_failure"]) == -1
        assert out["reason"].dtype.kind == "U"
        assert (out["reason"] == "").all()
        floats = SHAPES.keys() - {"settled", "traversable", "first_failure", "reason"}
        assert all(out[name].dtype == np.float64 for name in floats)
        assert out["wheel_loads"].sum(axis=1) == pytest.approx(out["wheel_loads"][0].sum())


def test_a_refused_path_is_still_exit_code_0_with_the_reason_and_nan(files):
    poses = np.column_stack([np.linspace(1, 7, N), np.full(N, 2.0), np.zeros(N)])
    np.savez(files / "poses.npz", poses=poses)
    assert main(arguments(files)) == 0
    with np.load(files / "out.npz") as out:
        first = int(out["first_failure"])
        assert not out["traversable"]
        assert first > 0
        assert out["reason"][first] != ""
        assert (out["reason"][:first] == "").all()
        assert not out["settled"][-1]
        assert np.isnan(out["position"][-1]).all()
        assert np.isnan(out["wheel_loads"][-1]).all()


def test_options_change_the_prediction(files):
    assert main([*arguments(files), "--friction", "0.4", "--max-torque", "3"]) == 0
    with np.load(files / "out.npz") as out:
        little = out["friction_utilisation"].copy()
    assert main([*arguments(files), "--policy", "optimal"]) == 0
    assert main([*arguments(files), "--friction", "0.8", "--policy", "equal"]) == 0
    with np.load(files / "out.npz") as out:
        assert out["friction_utilisation"] == pytest.approx(little / 2)


def test_output_goes_to_exactly_the_file_named(files):
    assert main(arguments(files, out="prediction.data")) == 0
    assert (files / "prediction.data").is_file()


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ([], "command"),
        (["dance"], "dance"),
        (["predict"], "ROVER"),
        (["predict", "lsr1", "t", "p", "o", "--colour", "red"], "--colour"),
        (["predict", "lsr1", "t", "p", "o", "extra"], "extra"),
        (["predict", "lsr1", "t", "p", "o", "--friction", "high"], "friction"),
        (["predict", "lsr1", "t", "p", "o", "--friction"], "friction"),
        (["terrain", "t.npz", "--seed", "x"], "seed"),
    ],
)
def test_usage_errors_are_one_line(capfd, words, names):
    code = main(words)
    assert_refused(capfd, code, names)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"rover": "curiosity"}, "curiosity"),
        ({"terrain": "none.npz"}, "none.npz"),
        ({"poses": "none.npz"}, "none.npz"),
        ({"terrain": "poses.npz"}, "elevation"),
        ({"poses": "terrain.npz"}, "poses"),
        ({"out": "no/such/folder/out.npz"}, "out.npz"),
        ({"out": "."}, "cannot write"),
    ],
)
def test_wrong_files_are_one_line(capfd, files, change, names):
    code = main(arguments(files, **change))
    assert_refused(capfd, code, names)


@pytest.mark.parametrize(
    "poses",
    [
        np.zeros((4, 2)),
        np.zeros(3),
        np.zeros((0, 3)),
        np.full((4, 3), np.nan),
        np.array([["a", "b", "c"]]),
        np.zeros((2, 3), dtype=complex),
        np.array([[{}, {}, {}]], dtype=object),
    ],
)
def test_impossible_poses_are_one_line(capfd, files, poses):
    np.savez(files / "poses.npz", poses=poses)
    assert_refused(capfd, main(arguments(files)), "pose")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not a zip", b"hello", b"\x93NUMPY"])
def test_files_of_another_kind_are_one_line(capfd, files, content):
    (files / "poses.npz").write_bytes(content)
    assert_refused(capfd, main(arguments(files)), "poses.npz")
    (files / "terrain.npz").write_bytes(content)
    assert_refused(capfd, main(arguments(files)), "terrain.npz")


def test_a_bare_array_is_no_poses_file(capfd, files):
    with open(files / "poses.npz", "wb") as file:
        np.save(file, np.zeros((3, 3)))
    assert_refused(capfd, main(arguments(files)), ".npz")


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--policy", "lucky"),
        ("--friction", "0"),
        ("--friction", "-1"),
        ("--friction", "nan"),
        ("--max-torque", "0"),
        ("--max-torque", "inf"),
    ],
)
def test_impossible_options_are_one_line(capfd, files, option, value):
    code = main([*arguments(files), option, value])
    assert_refused(capfd, code, "policy" if "policy" in option else value.lstrip("-"))


def test_a_bad_rover_file_is_one_line_that_names_the_key(capfd, files):
    (files / "rover.yaml").write_text("name: half\ngravity: 9.81\n")
    assert_refused(capfd, main(arguments(files, rover=files / "rover.yaml")), "wheel")
    (files / "rover.yaml").write_text("name: [unclosed\n")
    assert_refused(capfd, main(arguments(files, rover=files / "rover.yaml")), "rover.yaml")


def test_refusal_of_the_program_is_exit_code_2_and_one_line(files):
    result = run(*arguments(files, terrain="none.npz"))
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1


def test_terrain_command_makes_the_same_map_for_the_same_seed(tmp_path, capfd):
    for name in ("a.npz", "b.npz"):
        words = ["terrain", str(tmp_path / name), "--seed", "5", "--size", "4"]
        assert main(words) == 0
    a, b = load_terrain(tmp_path / "a.npz"), load_terrain(tmp_path / "b.npz")
    assert np.array_equal(a.elevation, b.elevation)
    assert_refused(capfd, main(["terrain", str(tmp_path / "c.npz"), "--size", "-1"]), "size")
    assert_refused(capfd, main(["terrain", str(tmp_path / "no" / "c.npz")]), "c.npz")


def test_help_is_exit_code_0(capfd):
    assert main(["--help"]) == 0
    assert main(["predict", "--help"]) == 0
    assert "TERRAIN" in capfd.readouterr().out
