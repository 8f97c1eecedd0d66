# SPDX-License-Identifier: Apache-2.0
"""The plant that simulates a rover in MuJoCo, with inertia and wheel slip."""

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import matrix_from_xyzw
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.simulator.mujoco_rover import MujocoRover
from rover_planner.simulator.plant import PlantState

MAX_TILT = 1.2
"""Tilt above which a rover counts as tipped over [rad]."""


class MujocoPlant:
    """A `MujocoRover` driven by speeds or torques; with fixed wheels it skids in curves."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        pose: tuple[float, float, float],
        friction: float | None = None,
    ):
        """Drop a rover onto the ground.

        Raises:
            PlanningError: The terrain has unknown cells, or the pose is outside the terrain.
        """
        self.simulated = MujocoRover(rover, terrain, pose, friction)
        """The rover in MuJoCo."""
        self._rover = rover
        sides = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
        self._arms = sides * abs(rover.suspension.wheels["middle"][1])
        self._torques = np.zeros(6)
        self._last = self.simulated.pose[:3]
        self._velocity = np.zeros(3)

    def pose(self) -> Floats:
        """Return x, y [m] and yaw [rad] (3,) of the body origin."""
        return self.simulated.pose[[0, 1, 3]]

    def drive(self, speed: float, yaw_rate: float, duration: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] for a duration [s], with speed servos."""
        if self._rover.steering is None:
            speeds = speed + yaw_rate * self._arms
        else:
            speeds = self.simulated.steer((speed, yaw_rate))
        self._torques = self.simulated.servo(speeds / self._rover.wheel.radius, duration)
        self._measure(duration)

    def pull(self, torques: Floats, command: tuple[float, float], duration: float) -> None:
        """Apply torques (6,) [N m] for a duration [s]; speed and yaw rate set the steering.

        With fixed wheels the torques also steer.
        """
        self.simulated.steer(command)
        self._torques = np.asarray(torques, dtype=float)
        self.simulated.step(self._torques, duration)
        self._measure(duration)

    def brake(self, duration: float) -> None:
        """Lock the wheels for a duration [s]."""
        self._torques = np.zeros(6)
        self.simulated.brake(duration)
        self._measure(duration)

    def _measure(self, duration: float) -> None:
        now = self.simulated.pose[:3]
        moved = (now - self._last) / duration
        R = matrix_from_xyzw(self.simulated.orientation)
        self._velocity, self._last = R.T @ moved, now

    def state(self) -> PlantState:
        """Return the current measurements."""
        plant = self.simulated
        return PlantState(
            position=plant.pose[:3],
            orientation=plant.orientation,
            velocity=self._velocity,
            body_rates=plant.body_rates,
            joint_positions=plant.joint_positions,
            joint_velocities=plant.joint_velocities,
            wheel_torques=self._torques,
            stopped="the rover has tipped over" if plant.tilt > MAX_TILT else plant.refusal,
        )
