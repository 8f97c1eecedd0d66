# SPDX-License-Identifier: Apache-2.0
"""On a slope of 20 degrees in MuJoCo a rover is held, as docs/validation.md says."""

import importlib

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="install the extra bench")
SLOPE = np.radians(20.0)


def test_hold_stops_a_rover_that_climbs_and_keeps_it_there():
    hold = importlib.import_module("benchmarks.hold")
    rest = hold.rest_on_slope("m2020", "hold", "imu lost", SLOPE, 2.0)
    assert rest.state != "driving" and not rest.brake
    assert rest.peak < 0.04 and abs(rest.speed) < 0.003


def test_the_brake_holds_and_a_rover_without_torque_and_brake_rolls_away():
    hold = importlib.import_module("benchmarks.hold")
    rest = hold.rest_on_slope("lsr1", "brake", "wheel rates lost", SLOPE, 1.0)
    assert rest.brake and rest.peak < 0.02
    rest = hold.rest_on_slope("lsr1", "coast", "imu lost", SLOPE, 1.0)
    assert rest.end < -0.5 and not rest.brake
