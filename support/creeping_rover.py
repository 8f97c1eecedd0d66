# SPDX-License-Identifier: Apache-2.0
"""A rover that creeps over level ground, as its traction controller measures it."""

import numpy as np

from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.supervisor import TractionSupervisor

PERIOD = 0.02
INPUTS = ("joint_states", "imu", "cmd_vel")


class CreepingRover:
    """A supervisor and the measurements that it gets."""

    def __init__(self, command=(0.03, 0.0), enabled=True, **values):
        """Start with the parameters of the controller that differ from their defaults."""
        settings = load_traction_settings(TractionControllerParameters(**values))
        self.supervisor = TractionSupervisor(settings, enabled)
        self.service, self.command = self.supervisor.service, command
        self.now, self.pitch, self.rates, self.updates = 0.0, 0.0, np.zeros(3), []
        self.positions = dict.fromkeys((*SUSPENSION_JOINTS, *STEERING_JOINTS), 0.0)
        self.velocities = dict.fromkeys(SUSPENSION_JOINTS, 0.0)
        self.turn_wheels(0.2)

    def turn_wheels(self, rate):
        """Turn all wheels at a rate [rad/s]."""
        self.velocities |= dict.fromkeys(WHEEL_JOINTS, rate)

    def send(self, *names):
        """Send some inputs."""
        if "joint_states" in names:
            self.service.take_joints(self.positions, self.velocities, self.now)
        if "imu" in names:
            self.service.take_attitude(0.0, self.pitch, self.rates, self.now)
        if "cmd_vel" in names:
            self.service.take_command(*self.command, self.now)

    def run(self, seconds, *names):
        """Update for a time [s], with some inputs or all; return the last command."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.send(*(names or INPUTS))
            self.updates.append(self.supervisor.update(self.now))
        return self.updates[-1]
