# SPDX-License-Identifier: Apache-2.0
"""Speed servos with droop, and a rover that is held on a slope, in MuJoCo."""

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steered_drive import SteeredDrive
from support.rough_grounds import plane

pytest.importorskip("mujoco", reason="install the extra bench")
import importlib

import pytest

from rover_planner.simulator.mujoco_rover import MujocoRover

LSR1 = load_rover("lsr1")
SPEED, CURVATURE = 0.03, 0.5


def test_servos_with_droop_drive_a_rover_along_the_curve_of_its_wheels():
    plant, drive = MujocoRover(LSR1, plane(0.0, 0.0)), SteeredDrive(LSR1)
    aims = drive.aim(SPEED, CURVATURE * SPEED)
    plant.steer(aims.angles)
    plant.servo(np.zeros(6), 2.0)
    for _ in range(3):
        plant.servo_with_droop(aims.speeds / LSR1.wheel.radius, 0.3, 2.0)
    np.testing.assert_allclose(plant.steering_angles, aims.angles, atol=0.01)
    assert plant.body_rates[2] == pytest.approx(CURVATURE * SPEED, rel=0.1)
    assert plant.pose[3] == pytest.approx(CURVATURE * SPEED * 6.0, rel=0.1)


def test_servos_with_droop_lose_speed_by_their_torque():
    slope, most = 0.2, LSR1.wheel.max_torque
    plant = MujocoRover(LSR1, plane(slope, 0.0))
    rate = SPEED / LSR1.wheel.radius
    torques = plant.servo_with_droop(np.full(6, rate), 0.3, 4.0)
    needed = LSR1.weight * np.sin(np.arctan(slope)) * LSR1.wheel.radius
    assert torques.sum() == pytest.approx(needed, rel=0.03)
    lost = 1.0 - plant.wheel_rates / rate
    np.testing.assert_allclose(lost, 0.3 * torques / most, atol=5e-3)


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
