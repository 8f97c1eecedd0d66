"""The simulator's engine can be chosen by an option of its own, beside ROS's arguments."""

import pytest

from rover_planner.rover_simulator import _with_engine


def test_the_option_becomes_the_parameter_and_the_rest_stays():
    given = ["rover_simulator", "--engine", "mujoco", "--ros-args", "-p", "rate:=10.0"]
    assert _with_engine(given) == [
        "rover_simulator", "--ros-args", "-p", "rate:=10.0", "--ros-args", "-p", "engine:=mujoco",
    ]  # fmt: skip
    assert _with_engine(["rover_simulator"]) == ["rover_simulator"]


def test_an_engine_that_is_none_is_refused(capsys):
    with pytest.raises(SystemExit):
        _with_engine(["rover_simulator", "--engine", "steam"])
    assert "quasi_static" in capsys.readouterr().err
