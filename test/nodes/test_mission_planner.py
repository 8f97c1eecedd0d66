"""The mission planner reads its goals, and says so when no server answers."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rover_planner.nodes.mission_planner import main

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ([], "--start"),
        (["--start=0,0,0"], "--goal"),
        (["--start=0,0", "--goal=1,0,0"], "0,0"),
        (["--start=0,0,0", "--goal=home"], "home"),
    ],
)
def test_bad_arguments_are_exit_code_2(capfd, words, names):
    with pytest.raises(SystemExit) as exit_info:
        main(words)
    assert exit_info.value.code == 2
    assert names in capfd.readouterr().err


def test_a_bad_map_is_exit_code_2_with_one_line(capfd, tmp_path):
    words = ["--start=0,0,0", "--goal=1,0,0", f"--map={tmp_path / 'none.npz'}"]
    assert main(words) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert "none.npz" in err


def test_without_a_server_it_gives_up_in_time_and_says_what_it_waited_for():
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "rover_planner.nodes.mission_planner",
            "--start=0,0,0",
            "--goal=1,0,0",
            "--timeout=1",
        ],
        cwd=REPOSITORY,
        env=os.environ
        | {
            "ROS_DOMAIN_ID": "99",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONPATH": str(REPOSITORY),
        },
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert result.returncode == 1
    assert "can_traverse" in result.stderr
    assert "Traceback" not in result.stderr
