# SPDX-License-Identifier: Apache-2.0
"""The command learn takes a bag as well as a CSV file."""

import json

import pytest

from rover_physics import load_rover, save_terrain
from rover_planner.cli import main
from rover_planner.learning.drive_log import TIME
from support.command_line import assert_refused
from support.learning_drives import climb, ramp, write_csv

pytest.importorskip("rosbags", reason="install the extra bags")
from rover_planner.ros.bags.bag_files import write_bag
from support.messages import row_messages

SLOPE = 0.3


def test_a_bag_tells_the_same_as_a_csv_file(tmp_path, capfd):
    rows = climb(load_rover("lsr1"), SLOPE, 8.0)
    save_terrain(tmp_path / "ramp.npz", ramp(SLOPE))
    write_csv(tmp_path / "drive.csv", rows)
    with write_bag(tmp_path / "bag") as bag:
        for row in rows:
            joints, odometry = row_messages(row, 0.0)
            stamp = 1_700_000_000_000_000_000 + round(1e9 * row[TIME])
            bag.write("/joint_states", joints, stamp)
            bag.write("/odometry", odometry, stamp + 1)
    found = []
    for log in ("bag", "drive.csv"):
        words = [str(tmp_path / name) for name in ("ramp.npz", log, "out.json")]
        assert main(["learn", "lsr1", *words]) == 0
        found.append(json.loads((tmp_path / "out.json").read_text())["friction"])
    assert found[0]["low"] == pytest.approx(found[1]["low"], rel=0.01)
    assert found[0]["high"] is None
    with write_bag(tmp_path / "empty") as bag:
        bag.write("/odometry", row_messages(rows[0], 0.0)[1], 1)
    words = [str(tmp_path / name) for name in ("ramp.npz", "empty", "out.json")]
    assert_refused(capfd, main(["learn", "lsr1", *words]), "joints")
