# SPDX-License-Identifier: Apache-2.0
"""`predict` keeps its contract: arrays in a file, exit code 0, or exit code 2 and one line."""

import numpy as np
import pytest

from rover_physics import load_terrain, save_terrain
from rover_physics.names import WHEELS
from rover_planner.cli import main
from rover_planner.command.prediction_files import read_prediction
from rover_planner.errors import PlanningError
from support.command_line import N, assert_refused, predict_arguments, write_ground_and_path
from support.grounds import with_std
from support.paths import poses_at

ASSUMED = '{"rover": "lsr1", "policy": "equal"'
SHAPES = {
    name: shape
    for shape, names in {
        (): "traversable first_failure assumptions",
        (N,): "settled roll pitch tip_over_ratio tip_over_force_angle belly_clearance energy time "
        "reason status power distance speed_share stalls",
        (N, 2): "rocker_angle bogie_angle drift",
        (N, 3): "position poses motion deviation",
        (N, 6): "wheel_loads tangential lateral friction_utilisation slip_ratio torque_saturation "
        "steering_angle wheel_speed contact_angle torque friction sinkage motion_resistance "
        "wheel_drop falling slip_speed lift_rate lift_height",
        (N, 6, 3): "wheel_centres contact_points",
    }.items()
    for name in names.split()
}
"""Shapes of arrays by their names."""
TYPES = {
    "traversable": "b", "first_failure": "i", "assumptions": "U", "settled": "b", "reason": "U",
    "status": "i", "falling": "b",
}  # fmt: skip
"""Kinds of the types of arrays that hold no floats."""


@pytest.fixture
def files(tmp_path):
    return write_ground_and_path(tmp_path)


def make_uncertain(file):
    """Give the map in a file standard deviations."""
    save_terrain(file, with_std(load_terrain(file), 0.004))


def test_an_uncertain_map_adds_bounds_unless_told_not_to(files):
    make_uncertain(files / "terrain.npz")
    words = predict_arguments(files)
    assert main([*words, "--sigmas", "2", "--friction", "0.2"]) == 0
    with np.load(files / "out.npz") as out:
        assert out["map_sigmas"] == 2.0
        for name in ("roll", "belly_clearance", "bogie_angle", "wheel_loads"):
            bounds = out[f"{name}_bounds"]
            assert bounds.shape == (*out[name].shape, 2)
            assert (bounds[..., 0] < out[name]).all() and (bounds[..., 1] > out[name]).all()
        assert not out["traversable"]
        assert out["reason"][0].endswith("at worst within 2 sigma of the map")
    assert main([*words, "--sigmas", "0", "--friction", "0.2"]) == 0
    with np.load(files / "out.npz") as out:
        assert out["traversable"]
        assert not [name for name in out.files if name.endswith("_bounds")]


def test_prediction_has_every_array_of_the_contract(files, capfd):
    assert main(predict_arguments(files)) == 0
    told = f"wrote {files / 'out.npz'}: {N} waypoints, traversable\n"
    assert capfd.readouterr() == (told, "")
    with np.load(files / "out.npz", allow_pickle=False) as out:
        assert {name: out[name].shape for name in out.files} == SHAPES
        assert {name: out[name].dtype.kind for name in TYPES} == TYPES
        assert all(out[name].dtype == np.float64 for name in SHAPES.keys() - TYPES)
        assert out["traversable"] and out["first_failure"] == -1
        assert (out["reason"] == "").all()


def test_a_refused_path_is_still_exit_code_0_with_the_reason_and_nan(files, capfd):
    np.savez(files / "poses.npz", poses=poses_at(np.linspace(1, 7, N), 2.0))
    assert main(predict_arguments(files)) == 0
    with np.load(files / "out.npz") as out:
        first, reasons = int(out["first_failure"]), out["reason"]
        assert not out["traversable"] and first > 0
        assert reasons[first] != "" and (reasons[:first] == "").all()
        told = f"{N} waypoints, not traversable from waypoint {first} on: {reasons[first]}"
        assert capfd.readouterr().out == f"wrote {files / 'out.npz'}: {told}\n"
        assert not out["settled"][-1] and np.isnan(out["wheel_loads"][-1]).all()


def test_waypoints_that_are_far_apart_are_warned_of(files, capfd):
    words = predict_arguments(files)
    np.savez(files / "poses.npz", poses=poses_at(0.1 * np.arange(20)))  # a wheel radius apart
    assert main(words) == 0 and "warning" not in capfd.readouterr().err
    np.savez(files / "poses.npz", poses=poses_at([0.0, 0.1, 0.2012]))
    assert main(words) == 0
    assert "from waypoint 1 to 2 it is 0.1012 m" in capfd.readouterr().err


@pytest.mark.parametrize("chance", [["--chance"], ["--accepted-chance", "0.01"]])
def test_classes_torque_ranges_and_chances_are_added_on_demand(files, chance):
    words = "--classes", "--torque-ranges", *chance
    assert main([*predict_arguments(files), *words]) == 0
    with np.load(files / "out.npz", allow_pickle=False) as out:
        names = ("traversability_class", "class_constraint", "class_wheel", "class_margin")
        shapes = SHAPES | dict.fromkeys((*names, "failure_chance_at"), (N,))
        shapes |= {"torque_range": (N, 6, 2), "failure_chance": ()}
        assert {name: out[name].shape for name in out.files} == shapes
        assert set(out["traversability_class"]) == {"passable"}
        assert set(out["class_constraint"]) <= {"friction", "torque", "wheel_lift"}
        assert set(out["class_wheel"]) <= set(WHEELS) and (out["class_margin"] > 0.5).all()
        assert (np.sign(out["torque_range"]) == [-1.0, 1.0]).all()
        assert 0.0 <= out["failure_chance_at"].max() <= out["failure_chance"] <= 1.0


def test_each_option_changes_the_prediction_as_it_should(files):
    loads, uses = {}, {}
    stretched = ["arm_yaw=0", "arm_shoulder=0", "arm_elbow=0"]
    for name, words in {
        "plain": [],
        "slippery": ["--friction", "0.4", "--max-torque", "3"],
        "optimal": ["--policy", "optimal", "--control-margin", "0.1"],
        "stretched": [word for joint in stretched for word in ("--arm", joint)],
        "payload": ["--payload", "1.5"],
        "force": ["--tool-force", "0", "0", "5.5"],
        "moment": ["--tool-moment", "0", "-2", "0"],
    }.items():
        assert main([*predict_arguments(files), *words]) == 0
        with np.load(files / "out.npz") as out:
            loads[name] = out["wheel_loads"][0].copy()
            uses[name] = out["friction_utilisation"].copy()
            assert f'"{name}"' in str(out["assumptions"]) or name != "optimal"
    assert uses["slippery"] == pytest.approx(2.0 * uses["plain"])
    front, stowed = [2, 5], loads["plain"]
    weight = stowed.sum()
    assert loads["stretched"][front].sum() > stowed[front].sum() + 0.1
    assert loads["payload"].sum() == pytest.approx(weight + 1.5 * 9.81)
    assert loads["force"].sum() == pytest.approx(weight - 5.5)
    assert loads["moment"][front].sum() < stowed[front].sum() - 0.1


@pytest.mark.parametrize(
    "words", [[], ["--soil", "dry_sand"], ["--sigmas", "2", "--friction", "0.2"]]
)
def test_a_long_path_that_is_written_in_parts_gives_the_same_file(files, monkeypatch, words):
    if "--sigmas" in words:
        make_uncertain(files / "terrain.npz")
    assert main([*predict_arguments(files), *words]) == 0
    monkeypatch.setattr("rover_planner.command.prediction_files.MAX_IN_MEMORY", 0)
    monkeypatch.setattr("rover_planner.command.prediction_files.BLOCK", 7)
    monkeypatch.setattr("rover_physics.prediction.sweep.PART", 10)
    assert main([*predict_arguments(files, out="parts.npz"), *words]) == 0
    with np.load(files / "out.npz") as whole, np.load(files / "parts.npz") as parts:
        assert set(parts.files) == set(whole.files)
        for name in whole.files:
            assert parts[name].dtype == whole[name].dtype
            np.testing.assert_array_equal(parts[name], whole[name], err_msg=name)
        assert whole["traversable"] == ("--friction" not in words)
    assert sorted(path.name for path in files.iterdir() if path.name.startswith(".")) == []


def test_a_disk_that_is_full_is_one_line_and_leaves_no_temporary_file(files, monkeypatch, capfd):
    monkeypatch.setattr("rover_planner.command.prediction_files.MAX_IN_MEMORY", 0)
    (files / "out.npz").symlink_to("/dev/full")
    assert_refused(capfd, main(predict_arguments(files)), "No space left on device")
    assert [path.name for path in files.iterdir() if path.name.startswith(".")] == []


def test_poses_with_curvature_are_taken_one_by_one_and_part_by_part(files, monkeypatch):
    bends = [0.0, 1.0, -1.0, np.inf, -np.inf]
    np.savez(files / "poses.npz", poses=poses_at(np.linspace(1.0, 3.0, 5), 2.0), curvature=bends)
    assert main(predict_arguments(files)) == 0
    monkeypatch.setattr("rover_planner.command.prediction_files.MAX_IN_MEMORY", 2)
    assert main(predict_arguments(files, out="parts.npz")) == 0
    with np.load(files / "out.npz") as out, np.load(files / "parts.npz") as parts:
        for name in out.files:
            np.testing.assert_array_equal(parts[name], out[name], err_msg=name)
        angles, speeds = out["steering_angle"], out["wheel_speed"]
        assert out["traversable"] and (angles[0] == 0.0).all()
        assert angles[1, 5] > 0.0 > angles[2, 5]
        assert speeds[3] == pytest.approx(-speeds[4]) and (speeds[3, :3] > 0.0).all()
        assert out["time"].tolist() == [0.0] * 5 == out["energy"].tolist()


# Files that hold something else


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"reason": None}, "no array reason; it has "),
        ({"assumptions": np.str_('{"rover": "lsr1"}')}, "assumptions are invalid"),
        ({"assumptions": np.str_(ASSUMED + ', "friction": NaN}')}, "assumptions are invalid"),
        ({"assumptions": np.str_(ASSUMED + ', "colour": "red"}')}, "assumptions are invalid"),
        ({"assumptions": np.float64(1.0)}, "assumptions is of type float64; it must hold texts"),
        ({"roll": np.float64(1.0)}, r"roll has shape \(\); it must be \(30,\)"),
        ({"settled": np.zeros(N)}, "settled is of type float64; it must hold bools"),
        ({"position": np.full((N, 3), np.nan)}, "position has a value that is NaN or beyond"),
    ],
)
def test_a_file_of_other_shapes_or_types_is_refused(files, changes, names):
    assert main(predict_arguments(files)) == 0
    with np.load(files / "out.npz") as out:
        changed = dict(out) | changes
    np.savez(files / "bad.npz", **{key: one for key, one in changed.items() if one is not None})
    with pytest.raises(PlanningError, match=names):
        read_prediction(files / "bad.npz")
