# SPDX-License-Identifier: Apache-2.0
"""`reach` answers in JSON, or ends with exit code 2 and one line."""

import json

import pytest

from rover_planner.cli import main
from support.command_line import write_ground_and_path


@pytest.fixture
def files(tmp_path):
    return write_ground_and_path(tmp_path)


def ask_reach(files, *words, rover="lsr1"):
    return main(["reach", rover, str(files / "terrain.npz"), *words])


def test_reach_answers_in_json_whatever_the_answer(capfd, files):
    there = ["2.0", "2.0", "0.5", "2.5", "2.3", "0.3"]
    assert ask_reach(files, *there) == 0
    answer = json.loads(capfd.readouterr().out)
    assert answer["possible"] and answer["reachable"] and answer["code"] == ""
    assert set(answer["joint_angles"]) == {"arm_yaw", "arm_shoulder", "arm_elbow"}
    free = answer["wheel_loads"]
    assert ask_reach(files, *there, "--force", "0", "0", "-10", "--payload", "0") == 0
    pushed = json.loads(capfd.readouterr().out)["wheel_loads"]
    assert sum(pushed) == pytest.approx(sum(free) + 10.0)
    assert ask_reach(files, *there[:3], "-3.5", "2.0", "0.3") == 0
    answer = json.loads(capfd.readouterr().out)
    assert not answer["possible"] and answer["code"] == "too_far" and answer["out_of_reach"] > 4.0
    assert ask_reach(files, *there, "--force", "-500", "0", "0") == 0
    answer = json.loads(capfd.readouterr().out)
    assert answer["reachable"] and not answer["possible"] and answer["reason"]
    assert ask_reach(files, "-9.0", *there[1:]) == 0
    assert json.loads(capfd.readouterr().out)["code"] == "off_map"
