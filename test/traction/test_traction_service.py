# SPDX-License-Identifier: Apache-2.0
"""Torques from measurements: zero at once when anything is missing, back when it is there."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.names import WHEEL_JOINTS
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.rover.steering_joints import steered_wheels, steering_joints
from rover_planner.parameters.traction_controller import COAST, TractionControllerParameters
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.supervisor import RECOVERY_TIME
from support.creeping_rover import PERIOD, CreepingRover
from support.grounds import plane
from support.rovers import FIXED, LSR1

STEERED = steering_joints(LSR1)
AGAIN = RECOVERY_TIME + 3 * PERIOD
"""Time after which it drives again once all is right [s]."""


class Rig(CreepingRover):
    """A rover without torques at rest."""

    def __init__(self, command=(0.03, 0.0), **values):
        super().__init__(command, rest_policy=COAST, **values)

    def roll(self, share):
        """Turn the wheels for the command, and let them roll at a share of what it asks."""
        aims = SteeredDrive(LSR1).aim(*self.command)
        rates = share * aims.speeds / LSR1.wheel.radius
        self.positions |= dict(zip(STEERED, aims.angles[steered_wheels(LSR1)], strict=True))
        self.velocities |= dict(zip(WHEEL_JOINTS, rates, strict=True))
        self.rates = np.array([0.0, 0.0, share * self.command[1]])
        return rates


def test_a_missing_joint_stops_the_wheels_within_a_tenth_of_a_second():
    rig = Rig()
    rig.run(0.6)
    rate = rig.velocities.pop("rear_left_wheel")
    assert rig.run(PERIOD).fault == ""
    update = rig.run(0.08)
    assert not update.torques.any()
    text = "joint_states stale: none for 60 ms (no velocity of rear_left_wheel)"
    assert update.fault == text
    rig.velocities["rear_left_wheel"] = rate
    assert rig.run(AGAIN).fault == ""


def test_what_the_loops_added_up_is_forgotten_in_a_fault():
    rig = Rig()
    rig.turn_wheels(0.0)
    wound = np.abs(rig.run(1.2).torques).max()
    rig.now += 1.0
    assert not rig.supervisor.update(rig.now).torques.any()
    assert np.abs(rig.run(AGAIN).torques).max() < 0.5 * wound


def test_the_source_of_contact_angles_is_the_best_there_is():
    rig = Rig()
    assert rig.run(0.6).estimate.source == "motion"
    rig.service.take_terrain(plane(0.0, 0.0, half=2.0))
    rig.service.take_odometry(np.array([0.0, 0.0, 0.3, 0.0]), 0.01, rig.now)
    assert rig.run(PERIOD).estimate.source == "map"
    rig.now += 1.0
    assert rig.run(0.04).estimate.source == "motion"
    rig.rates = None
    update = rig.run(0.04)
    assert update.estimate.source == "zero" and "angular velocity" in update.warning
    assert update.torques.any()


@pytest.mark.parametrize(
    ("kind", "name", "value", "text"),
    [
        ("velocities", "front_left_wheel", 1000.0, "velocity 1000 of front_left_wheel"),
        ("positions", "bogie_right", 3.0, "position 3 of bogie_right; it must be in -1.4 to 1.4"),
        ("rates", 1, 1000.0, "imu has angular velocity [0.0, 1000.0, 0.0]"),
    ],
)
def test_an_impossible_measurement_is_a_fault_that_names_it(kind, name, value, text):
    rig = Rig()
    rig.run(0.6)
    getattr(rig, kind)[name] = value
    update = rig.run(PERIOD)
    assert text in update.fault and not update.torques.any()


def test_commands_are_reduced_to_what_the_wheels_can_do():
    service = Rig().service
    service.take_command(5.0, 0.0, 0.0)
    assert service.wanted == pytest.approx((0.1, 0.0))
    service.take_command(-0.1, 1.0, 0.0)
    speed, yaw_rate = service.wanted
    assert yaw_rate / speed == pytest.approx(-10.0)
    outer = np.hypot(abs(speed) + 0.31 * abs(yaw_rate), 0.4 * yaw_rate)
    assert outer == pytest.approx(0.1)
    service.take_command(0.03, 0.05, 0.0)
    assert service.wanted == (0.03, 0.05)


@pytest.mark.parametrize(
    "change", [{"friction": 0.3}, {"policy": "equal"}, {"travel_gain": 500.0}, {"rover": "m2020"}]
)
def test_no_change_of_a_parameter_moves_a_torque_faster_than_torque_rate(change):
    rig = Rig()
    rig.pitch = -0.2
    rig.velocities |= dict.fromkeys(WHEEL_JOINTS, 0.1) | {"rear_left_wheel": 0.4}
    last = rig.run(0.6).torques
    assert np.abs(last).max() > 0.2
    parameters = TractionControllerParameters(**change)
    rig.supervisor.configure(load_traction_settings(parameters, rig.service.settings))
    for _ in range(20):
        torques = rig.run(PERIOD).torques
        most = rig.service.settings.torque_rate * PERIOD
        assert np.abs(torques - last).max() <= most + 1e-9
        last = torques
    assert torques.any()


def test_it_pushes_up_a_slope_with_the_weight_along_it_within_a_third_of_a_second():
    rig = Rig(rover="m2020", speed_gain=0.0, travel_gain=0.0, heading_gain=0.0, slip_gain=0.0)
    rig.pitch = -np.radians(17.0)
    rig.velocities |= dict.fromkeys(WHEEL_JOINTS, 0.03 / 0.2625)
    rover = rig.service.settings.rover
    wanted = rover.weight * np.sin(-rig.pitch) * rover.wheel.radius
    while rig.run(PERIOD).torques.sum() < 0.9 * wanted:
        assert rig.now < 0.33
    update = rig.run(1.2)
    assert update.torques.sum() == pytest.approx(wanted, rel=0.01)
    assert update.answer.loads[0] > 1.2 * update.answer.loads[2]  # rear and front


def test_torques_that_are_no_numbers_are_a_fault(monkeypatch):
    rig = Rig()
    answer = replace(rig.run(0.6).answer, torques=np.full(6, np.nan))
    monkeypatch.setattr(rig.service, "_share_torques", lambda rows: answer)
    update = rig.run(PERIOD)
    assert "must be finite" in update.fault and not update.torques.any()


def test_wheels_that_spin_are_slowed_and_do_not_hide_that_the_others_stand():
    rig = Rig(speed_gain=0.0, travel_gain=0.0, heading_gain=0.0)
    rig.turn_wheels(0.0)
    rig.velocities |= dict.fromkeys(("front_right_wheel", "front_left_wheel"), 1.0)
    before, after = rig.run(0.2).torques, rig.run(4.0).torques
    assert before[2] < 0.0 < before[0]
    assert after[0] > 2.0 * before[0]
    assert np.abs(after).max() == LSR1.wheel.max_torque


# Wheels that steer


def test_a_rover_with_steering_asks_for_its_joints_and_guesses_nothing():
    rig = Rig()
    steered = rig.service.settings
    rig.supervisor.configure(replace(steered, rover=FIXED))
    known = {name: rig.positions.pop(name) for name in STEERED}
    assert rig.run(0.1).fault == ""
    rig.supervisor.configure(steered)
    update = rig.run(PERIOD)
    assert not update.torques.any()
    assert update.fault == f"waiting for joint_states (no position of {', '.join(STEERED)})"
    rig.positions |= known
    assert rig.run(AGAIN).fault == ""


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_rover_that_is_too_slow_is_pushed_along_its_curve(policy):
    for command in ((0.03, 0.03), (0.0, -0.05), (-0.03, 0.02)):
        rig = Rig(command, policy=policy)
        wanted = np.sign(rig.roll(1.0))
        assert np.abs(rig.run(2.0).torques).max() < 1e-3, command  # it rolls as wanted
        rig.roll(0.5)
        torques = rig.run(1.0).torques
        assert (wanted * torques > 1e-3).all(), (command, torques)


def test_a_rover_that_turns_unasked_is_turned_back():
    rig = Rig()
    rig.roll(1.0)
    rig.rates = np.array([0.0, 0.0, 0.05])  # to the left
    right, left = np.split(rig.run(0.6).torques, 2)
    assert right.max() < -1e-3 and left.min() > 1e-3


def test_straight_wheels_do_not_push_a_rover_that_is_to_turn_on_the_spot():
    rig = Rig((0.0, 0.1))
    rig.turn_wheels(0.0)
    update = rig.run(1.0)
    assert update.fault == "" and np.abs(update.torques).max() < 1e-6
    assert not rig.service.wanted_rates.any()


def test_a_command_beyond_the_steering_limit_is_named_and_not_driven():
    rig, narrow = Rig((0.0, 0.1)), replace(LSR1, steering=replace(LSR1.steering, limit=0.4))
    rig.supervisor.configure(replace(rig.service.settings, rover=narrow))
    rig.turn_wheels(0.0)
    update = rig.run(0.1)
    assert "steering angle of" in update.warning and not update.torques.any()
