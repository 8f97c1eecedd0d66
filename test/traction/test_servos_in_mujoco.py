# SPDX-License-Identifier: Apache-2.0
"""Speed servos with droop, and a rover that is held on a slope, in MuJoCo."""

from collections import deque

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="install the extra bench")

from rover_physics import Rover, load_rover
from rover_physics.rover.steered_drive import SteeredDrive
from rover_planner.parameters.traction_controller import (
    BRAKE,
    COAST,
    HOLD,
    TractionControllerParameters,
)
from rover_planner.simulator.mujoco_rover import MujocoRover
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.supervisor import TractionSupervisor
from support.grounds import plane
from support.reference_drives import drive_ground
from support.rovers import LSR1

SPEED, CURVATURE = 0.03, 0.5


def test_servos_with_droop_drive_a_rover_along_the_curve_of_its_wheels():
    plant, drive = MujocoRover(LSR1, plane(0.0, 0.0)), SteeredDrive(LSR1)
    aims = drive.aim(SPEED, CURVATURE * SPEED)
    plant.steer((SPEED, CURVATURE * SPEED))
    plant.servo(np.zeros(6), 2.0)
    for _ in range(3):
        plant.servo_with_droop(aims.speeds / LSR1.wheel.radius, 0.3, 2.0)
    np.testing.assert_allclose(plant.steering_angles, aims.angles, atol=0.01)
    assert plant.body_rates[2] == pytest.approx(CURVATURE * SPEED, rel=0.1)
    assert plant.pose()[2] == pytest.approx(CURVATURE * SPEED * 6.0, rel=0.1)


def test_servos_with_droop_lose_speed_by_their_torque():
    slope, most = 0.2, LSR1.wheel.max_torque
    plant = MujocoRover(LSR1, plane(slope, 0.0))
    rate = SPEED / LSR1.wheel.radius
    torques = plant.servo_with_droop(np.full(6, rate), 0.3, 4.0)
    needed = LSR1.weight * np.sin(np.arctan(slope)) * LSR1.wheel.radius
    assert torques.sum() == pytest.approx(needed, rel=0.03)
    lost = 1.0 - plant.wheel_rates / rate
    np.testing.assert_allclose(lost, 0.3 * torques / most, atol=5e-3)


def test_the_ground_never_pulls_a_wheel_down():
    """MuJoCo's own collision code reverses some normals between cylinders and height fields."""
    plant = MujocoRover(LSR1, drive_ground("step", 0.1), (-1.2, 0.0, 0.0))
    for _ in range(100):
        plant.drive(SPEED, 0.0, 0.02)
        contacts = plant._data.contact[: plant._data.ncon]
        assert all(contact.frame[2] > -0.01 for contact in contacts)


SLOPE, FRICTION = np.radians(20.0), 0.8
PERIOD, DELAY = 0.02, 2
"""Period of the updates [s], and how many of them a torque takes to the wheels."""
ENABLED, LOST = 1.0, 4.0
"""Times at which the rover is enabled and loses an input [s]."""


def rest_on_slope(rover: Rover, half: float, policy: str, event: str, seconds: float):
    """Climb a slope, `half` [m] long, lose an input and rest for a time [s].

    A brake that is commanded locks the wheels: with the policy brake only, as other rovers may
    have none. Torques reach the wheels two periods after the measurement.

    Returns:
        The last command, and distances along the slope since the event [m], positive uphill.
    """
    plant = MujocoRover(rover, plane(np.tan(SLOPE), 0.0, half=half), friction=FRICTION)
    parameters = TractionControllerParameters(
        rover=rover.name, rest_policy=policy, friction=FRICTION
    )
    supervisor = TractionSupervisor(load_traction_settings(parameters), False)
    delayed = deque([supervisor.update(plant.time)] * DELAY)
    places = []
    while plant.time < LOST + seconds:
        over = plant.time > LOST
        if ENABLED < plant.time <= LOST:
            supervisor.set_enabled(True)
        lost, service, now = event if over else "", supervisor.service, plant.time
        if lost != "wheel rates":
            service.take_joints(plant.joint_positions, plant.joint_velocities, now)
        if lost != "imu":
            service.take_attitude(*plant.attitude, plant.body_rates, now)
        service.take_command(rover.nominal_speed, 0.0, now)
        delayed.append(supervisor.update(plant.time))
        command = delayed.popleft()
        if policy == BRAKE and command.brake:
            plant.servo(np.zeros(6), PERIOD)
        else:
            plant.step(command.torques, PERIOD)
        if over:
            places.append(float(plant.pose()[0]))
    return command, (np.array(places) - places[0]) / np.cos(SLOPE)


def test_hold_stops_a_rover_that_climbs_and_keeps_it_there():
    command, along = rest_on_slope(load_rover("m2020"), 12.0, HOLD, "imu", 2.0)
    assert command.state != "driving" and not command.brake
    assert np.abs(along).max() < 0.04 and abs(along[-1] - along[-2]) < 0.003 * PERIOD


def test_the_brake_holds_and_a_rover_without_torque_and_brake_rolls_away():
    command, along = rest_on_slope(LSR1, 6.0, BRAKE, "wheel rates", 1.0)
    assert command.brake and np.abs(along).max() < 0.02
    command, along = rest_on_slope(LSR1, 6.0, COAST, "imu", 1.0)
    assert along[-1] < -0.5 and not command.brake
