# SPDX-License-Identifier: Apache-2.0
"""The command learn: drives from CSV files and bags, its file, and predictions with it."""

import json

import numpy as np
import pytest

from rover_physics.names import WHEEL_JOINTS
from rover_physics.rover.rover_file import save_rover
from rover_physics.terrain.grid import load_terrain, save_terrain
from rover_planner.cli import main
from rover_planner.learning.drive_log import PITCH, ROLL, STEERING, SUSPENSION, TIME, TORQUES, X
from support.command_line import assert_refused, predict_arguments
from support.grounds import plane
from support.learning_drives import NAMES, climb, write_csv
from support.rovers import LSR1 as ROVER

SLOPE = 0.3


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a terrain and a drive on it."""
    save_terrain(tmp_path / "ramp.npz", plane(SLOPE, 0.0, half=3.0))
    write_csv(tmp_path / "drive.csv", climb(ROVER, SLOPE, 8.0))
    return tmp_path


def arguments(folder, log="drive.csv", rover="lsr1"):
    return ["learn", str(rover), *(str(folder / n) for n in ("ramp.npz", log, "out.json"))]


def learn(folder, *words, log="drive.csv", rover="lsr1"):
    """Learn from a drive; return what is in the file."""
    assert main([*arguments(folder, log, rover), *map(str, words)]) == 0
    return json.loads((folder / "out.json").read_text())


def test_a_drive_without_slip_leaves_the_friction_open_above(folder, capfd):
    picture, ground = folder / "out.png", folder / "ground.npz"
    found = learn(folder, "--picture", picture, "--ground", ground)
    assert found["friction"]["high"] is None
    assert 0.0 < found["friction"]["low"] < SLOPE < found["friction"]["mean"]
    assert found["slip_time"] is None and found["immobilised_time"] is None
    assert picture.stat().st_size > 10_000
    layer = load_terrain(ground).friction
    assert layer is not None and np.isfinite(layer).any() and np.isnan(layer).any()


def test_columns_come_in_any_order_and_some_may_be_missing(folder):
    usual = learn(folder)["friction"]
    names = [name for name in NAMES if "steering" not in name]
    write_csv(folder / "drive.csv", climb(ROVER, SLOPE, 8.0), names[::-1])
    assert learn(folder)["friction"] == usual


def test_a_soil_is_learned_where_one_is_told(folder):
    soil = learn(folder, "--soil", "dry_sand")["soil"]
    assert soil["resistance"]["mean"] < 0.1 and "modulus" in soil["told_apart"]  # it rolls freely


def test_motor_currents_serve_with_the_constant_of_the_rover_file(folder, capfd):
    usual = learn(folder)["friction"]
    log = folder / "drive.csv"
    log.write_text(log.read_text().replace("_torque", "_current", 6))
    assert_refused(capfd, main(arguments(folder)), "torque_per_current")
    rover = folder / "rover.yaml"
    save_rover(rover, ROVER)
    text = rover.read_text().replace("servo_droop: 0.3", "servo_droop: 0.3, torque_per_current: 1")
    rover.write_text(text)
    assert learn(folder, rover=rover)["friction"] == usual


def test_force_sensors_replace_loads_and_tractions(folder):
    lines = (folder / "drive.csv").read_text().splitlines()
    felt = [f"{name.removesuffix('_wheel')}_f{axis}" for name in WHEEL_JOINTS for axis in "xz"]
    values = ",".join(["5.0,10.0"] * 6)
    lines = [f"{lines[0]},{','.join(felt)}", *(f"{line},{values}" for line in lines[1:])]
    (folder / "drive.csv").write_text("\n".join(lines))
    assert learn(folder)["friction"]["low"] == pytest.approx(0.5 * 0.84, abs=0.03)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda text: text.replace("rocker_left", "rocker_port"), "rocker_left"),
        (lambda text: text.replace("\n", ",\n0.1x", 3), "number"),
        (lambda text: text.splitlines()[0], "rows"),
        (
            lambda text: text.splitlines()[0] + "\n1700000012.5\n1700000012.4",
            "time goes back after 1700000012.5 s",
        ),
        (lambda text: "", "time"),
        (lambda text: text.replace("rear_right_steering", "time"), "two columns time"),
    ],
)
def test_a_bad_log_is_refused_in_one_line(folder, capfd, spoil, word):
    log = folder / "drive.csv"
    log.write_text(spoil(log.read_text()))
    assert_refused(capfd, main(arguments(folder)), word)


@pytest.mark.parametrize(
    ("columns", "spoil", "word"),
    [
        (ROLL, lambda one: np.nan * one, "roll has no value"),
        (SUSPENSION.stop - 1, lambda one: np.nan * one, "bogie_left has no value"),
        (TIME, lambda one: 1e9 * one, "rows are 2e+07 s apart; they must be 0.5 s or less, time"),
        (TIME, lambda one: 0.01 * one, "lasts 0.07"),
        (X, lambda one: 1000.0 * one, "known part of the map"),
        (PITCH, np.degrees, "pitch is -16"),
        (STEERING, lambda one: one + 30.0, "rear_right_steering is 30 at 0 s, and beyond 3.15 r"),
    ],
)
def test_a_drive_that_teaches_nothing_says_why(folder, capfd, columns, spoil, word):
    rows = climb(ROVER, SLOPE, 8.0)
    rows[:, columns] = spoil(rows[:, columns])
    write_csv(folder / "drive.csv", rows)
    assert_refused(capfd, main(arguments(folder)), word)
    assert not (folder / "out.json").exists()


def test_torques_that_were_not_measured_are_named_on_the_terminal(folder, capfd):
    rows = climb(ROVER, SLOPE, 8.0)
    rows[:, TORQUES.start : TORQUES.stop : 3] = np.nan
    write_csv(folder / "drive.csv", rows)
    learn(folder)
    warning = "sensors that were not believed: rear_right no torque, rear_left no torque"
    assert capfd.readouterr().err == f"warning: {warning}\n"


def test_a_spike_of_an_angle_is_ignored(folder):
    usual = learn(folder)["friction"]
    rows = climb(ROVER, SLOPE, 8.0)
    rows[200, PITCH], rows[300, SUSPENSION] = 500.0, -500.0
    write_csv(folder / "drive.csv", rows)
    assert learn(folder)["friction"]["mean"] == pytest.approx(usual["mean"], rel=0.02)


def test_a_prediction_takes_what_was_learned_in_place_of_the_told_friction(folder, capfd):
    np.savez(folder / "poses.npz", poses=np.zeros((1, 3)))
    words = [*predict_arguments(folder, terrain="ramp.npz"), "--friction", "0.7", "--chance"]
    words += ["--learned", str(folder / "learned.json")]
    chances = []
    for mean, high, assumed in ((0.4, 1.0, 0.4), (0.8, 1.0, 0.8), (0.4, None, 0.7)):
        friction = {"mean": mean, "std": 0.1, "low": 0.3, "high": high}
        (folder / "learned.json").write_text(json.dumps({"friction": friction}))
        assert main(words) == 0
        with np.load(folder / "out.npz") as file:
            np.testing.assert_allclose(file["friction"], assumed)
            assert json.loads(str(file["assumptions"]))["friction"] == assumed
            chances.append(float(file["failure_chance"]))
    assert chances[0] > 0.05 > chances[1]
    (folder / "learned.json").write_text("{}")
    assert_refused(capfd, main(words), "learned.json")


def test_a_bag_tells_the_same_as_a_csv_file(folder, capfd):
    pytest.importorskip("rosbags", reason="install the extra bags")
    from rover_planner.ros.bags.bag_files import write_bag
    from support.messages import row_messages

    with write_bag(folder / "bag") as bag:
        for row in climb(ROVER, SLOPE, 8.0):
            joints, odometry = row_messages(row, 0.0)
            stamp = 1_700_000_000_000_000_000 + round(1e9 * row[TIME])
            bag.write("/joint_states", joints, stamp)
            bag.write("/odometry", odometry, stamp + 1)
    of_bag, of_csv = (learn(folder, log=log)["friction"] for log in ("bag", "drive.csv"))
    assert of_bag["low"] == pytest.approx(of_csv["low"], rel=0.01) and of_bag["high"] is None
    with write_bag(folder / "empty") as bag:
        bag.write("/odometry", odometry, 1)
    assert_refused(capfd, main(arguments(folder, "empty")), "joints")
