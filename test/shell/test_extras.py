# SPDX-License-Identifier: Apache-2.0
"""Commands that need more than a plain installation say what, and run nothing."""

import sys

import pytest

from rover_planner.cli import main


@pytest.mark.parametrize(
    ("words", "module", "install"),
    [
        (("figure4", "out.png"), "matplotlib", "rover_planner[plots]"),
        (("study", "study.yaml"), "matplotlib", "rover_planner[plots]"),
        (("replay", "bag", "out"), "rosbags", "rover_planner[bags]"),
        (("replay", "bag", "out"), "rclpy", "rover_planner[ros]"),
        (("view",), "viser", "rover_planner[view]"),
        (("view", "--follow"), "rclpy", "rover_planner[ros]"),
    ],
)
def test_a_missing_library_is_named_with_what_installs_it(
    words, module, install, monkeypatch, tmp_path, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    assert main(words) == 2
    told = capsys.readouterr().err
    assert module in told or "ROS 2" in told
    assert install in told and "\n" not in told.strip()
    assert not list(tmp_path.iterdir())
