# SPDX-License-Identifier: Apache-2.0
"""The traction controller with wheels that steer: measured angles, their absence, curves."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.rover.steering_joints import steering_joints
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.traction_service import TractionService
from support.rough_grounds import plane

PERIOD = 0.02
SETTINGS = load_traction_settings(TractionControllerParameters())
LSR1 = SETTINGS.rover
JOINTS = steering_joints(LSR1)
FIXED = replace(SETTINGS, rover=replace(LSR1, steering=None))


def with_policy(policy):
    return load_traction_settings(TractionControllerParameters(policy=policy))


class Rig:
    """A service and the measurements of a rover whose wheels roll as commanded."""

    def __init__(self, settings=SETTINGS, command=(0.03, 0.0)):
        self.service, self.command, self.now = TractionService(settings), command, 0.0
        aims = SteeredDrive(settings.rover).aim(*command)
        self.steering, self.rates = aims.angles, aims.speeds / LSR1.wheel.radius
        self.yaw_rate = command[1]

    @property
    def positions(self):
        return dict.fromkeys(SUSPENSION_JOINTS, 0.0) | {
            name: self.steering[wheel] for name, wheel in zip(JOINTS, (0, 2, 3, 5), strict=True)
        }

    def run(self, count=30, without=()):
        velocities = dict.fromkeys(SUSPENSION_JOINTS, 0.0)
        velocities |= dict(zip(WHEEL_JOINTS, self.rates, strict=True))
        for _ in range(count):
            self.now += PERIOD
            known = {name: at for name, at in self.positions.items() if name not in without}
            self.service.take_joints(known, velocities, self.now)
            self.service.take_attitude(0.0, 0.0, np.array([0.0, 0.0, self.yaw_rate]), self.now)
            self.service.take_command(*self.command, self.now)
            update = self.service.update(self.now)
        return update


def test_steering_joints_that_are_missing_are_named_and_nothing_is_guessed():
    rig = Rig()
    update = rig.run(5, without=JOINTS)
    assert not update.torques.any()
    assert update.fault == f"waiting for joint_states (no position of {', '.join(JOINTS)})"
    assert rig.run(5).fault == ""
    update = rig.run(5, without=JOINTS[1:2])
    assert "stale" in update.fault and "no position of front_right_steering" in update.fault


def test_a_new_rover_with_steering_asks_for_its_joints():
    rig = Rig(FIXED)
    assert rig.run(5, without=JOINTS).fault == ""
    rig.service.settings = SETTINGS
    assert "rear_right_steering" in rig.run(1, without=JOINTS).fault
    assert rig.run(2).fault == ""


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_rover_that_is_too_slow_is_pushed_along_its_curve(policy):
    for command in ((0.03, 0.03), (0.0, -0.05), (-0.03, 0.02)):
        rig = Rig(with_policy(policy), command)
        assert np.abs(rig.run(100).torques).max() < 1e-3, command  # it rolls as wanted
        wanted = np.sign(rig.rates)
        rig.rates, rig.yaw_rate = 0.5 * rig.rates, 0.5 * rig.yaw_rate
        torques = rig.run(50).torques
        assert (wanted * torques > 1e-3).all(), (command, torques)


def test_straight_wheels_do_not_push_a_rover_that_is_to_turn_on_the_spot():
    rig = Rig(command=(0.0, 0.1))
    rig.steering, rig.rates, rig.yaw_rate = np.zeros(6), np.zeros(6), 0.0
    update = rig.run(50)
    assert update.fault == "" and np.abs(update.torques).max() < 1e-6
    assert not rig.service.wanted_rates.any()


def test_a_command_beyond_the_steering_limit_is_named_and_not_driven():
    narrow = replace(LSR1, steering=replace(LSR1.steering, limit=0.4))
    rig = Rig(replace(SETTINGS, rover=narrow), (0.0, 0.1))
    rig.rates, rig.yaw_rate = np.zeros(6), 0.0
    update = rig.run(5)
    assert "steering angle of" in update.warning and not update.torques.any()


def test_controller_and_simulator_turn_on_a_slope():
    plant = QuasiStaticPlant(LSR1, plane(0.1, 0.0, half=3.0), (0.0, 0.0, 0.0))
    service, command = TractionService(with_policy("equal")), (0.0, -0.1)
    service.take_terrain(plane(0.1, 0.0, half=3.0))
    for step in range(round(5.0 / PERIOD)):
        now, state = step * PERIOD, plant.state()
        service.take_joints(state.joint_positions, state.joint_velocities, now)
        x, y, z, w = state.orientation
        roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = np.arcsin(2.0 * (w * y - z * x))
        service.take_attitude(roll, pitch, state.body_rates, now)
        service.take_command(*command, now)
        service.take_odometry(np.array([*state.position, plant.pose()[2]]), 0.0, now)
        update = service.update(now)
        assert update.fault == "" and update.warning == ""
        plant.pull(update.torques, command, PERIOD)
    # Two seconds go into steering and the start.
    assert plant.pose()[2] == pytest.approx(command[1] * 4.0, abs=0.2 * abs(command[1] * 4.0))
    assert plant.pose()[:2] == pytest.approx([0.0, 0.0], abs=0.05)
