# SPDX-License-Identifier: Apache-2.0
"""The simulation without ROS: drives a plant along a path, by speeds or by torques."""

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rover_physics.names import EQUAL
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.errors import PlanningError
from rover_planner.parameters.rover_simulator import MUJOCO, RoverSimulatorParameters
from rover_planner.simulator.path_follower import MAX_TRIES, STUCK_TIME, PathFollower, SecondTry
from rover_planner.simulator.plant import PlantState
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.simulator.range_sensor import look
from rover_planner.worlds.mars_terrain import make_mars_terrain

if TYPE_CHECKING:
    from rover_planner.simulator.mujoco_rover import MujocoRover

Plant: TypeAlias = "QuasiStaticPlant | MujocoRover"
"""A simulated rover; all have the same methods."""
MADE_SIZE, MADE_RESOLUTION = 24.0, 0.05
"""Width and cell size of the generated terrain [m], the default terrain."""
WIDEST_GAP = 1e6
"""Width up to which unknown regions are ground like that around them [m]: any width."""


def load_ground(parameters: RoverSimulatorParameters) -> Terrain:
    """Load or generate the terrain of the parameters.

    Raises:
        RoverError: It cannot be loaded.
    """
    if parameters.terrain_file:
        return load_terrain(parameters.terrain_file, parameters.max_map_cells)
    return make_mars_terrain(parameters.seed, MADE_SIZE, MADE_RESOLUTION)


def _make_plant(rover: Rover, terrain: Terrain, asked: RoverSimulatorParameters) -> Plant:
    """Make the plant that the parameters name.

    Raises:
        PlanningError: MuJoCo is selected but not installed, a setting is not supported by it, or
            the rover cannot stand at the start.
        SoilError: No soil of that name.
    """
    ground = terrain.fill_gaps(WIDEST_GAP)  # in gaps that a server may interpolate, too
    start = asked.start_x, asked.start_y, asked.start_yaw
    placed = rover, ground, start, asked.friction or None
    if asked.engine != MUJOCO:
        return QuasiStaticPlant(*placed, asked.policy, asked.soil or None)
    if asked.soil:
        raise PlanningError(f"soil is {asked.soil!r}; it must be empty with the engine mujoco")
    if asked.policy != EQUAL:
        raise PlanningError(
            f"policy is {asked.policy!r}; it must be left out with the engine mujoco, whose "
            "servos hold speeds"
        )
    try:
        from rover_planner.simulator.mujoco_rover import MujocoRover
    except ImportError:
        raise PlanningError(
            "engine is mujoco, which is not installed: pip install 'rover_planner[bench]'"
        ) from None
    return MujocoRover(*placed)


class Simulation:
    """One simulated rover and its last commands."""

    def __init__(self, rover: Rover, terrain: Terrain, parameters: RoverSimulatorParameters):
        """Place a rover at its start.

        Args:
            rover: The rover.
            terrain: The true ground, as far as a sensor can see it.
            parameters: The parameters; empty texts and 0 stand for "as rover and terrain say".

        Raises:
            PlanningError, SoilError: As in `_make_plant`.
        """
        self.rover, self.terrain, self._parameters = rover, terrain, parameters
        self.plant = _make_plant(rover, terrain, parameters)
        self._rng = np.random.default_rng(parameters.seed)
        self._follower: SecondTry | None = None
        self._wanted, self._wanted_at = (0.0, 0.0), -np.inf
        self._torques, self._torques_at = np.zeros(6), -np.inf
        self.at_end = False
        """True once the end of the last path was reached."""
        self._brakes = False
        self._stops, self._stop_at, self._held = False, -np.inf, 0.0
        self.steering = (0.0, 0.0)
        """Speed [m/s] and yaw rate [rad/s] set by path or command."""

    def take_path(self, poses: Floats) -> None:
        """Follow a path of poses (n, 3), x, y [m], yaw [rad], from now on.

        A rover that a controller's torques drive tries again where it stands still.
        """
        rover = self.rover
        follower = PathFollower(poses, 0.5 * rover.wheelbase, swing_radius(rover))
        tries = MAX_TRIES if self._parameters.follow_commands else 1
        steering = rover.steering
        # From one limit to the other, while the rover stands.
        longest = 0.0 if steering is None else 2.0 * steering.limit / steering.rate
        patience = STUCK_TIME + longest
        self._follower = SecondTry(follower, rover.wheel.radius, tries, patience)
        self.at_end = False

    def take_speeds(self, speed: float, yaw_rate: float, now: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s] from time `now` [s]; ends path following."""
        self._follower = None
        self._wanted, self._wanted_at = (speed, yaw_rate), now

    def take_torques(self, torques: Floats, now: float) -> None:
        """Take torques (6,) [N m] in wheel order at time `now` [s]."""
        self._torques, self._torques_at = torques, now

    def take_brake(self, applied: bool) -> None:
        """Lock the wheels, or release them."""
        self._brakes = applied

    def take_stop(self, stops: bool, now: float) -> None:
        """Take what the watch of the path says at time `now` [s]: whether the rover is to stop."""
        self._stops, self._stop_at = stops, now

    def _may_drive(self, now: float) -> bool:
        """Return whether the watch of the path, if there is to be one, lets the rover drive."""
        timeout = self._parameters.stop_timeout or np.inf
        return not self._stops and now - self._stop_at <= timeout

    def has_speeds(self, now: float) -> bool:
        """Return whether commanded speeds apply: they are recent and no path is followed."""
        return self._follower is None and now - self._wanted_at <= self._parameters.timeout

    @property
    def follows_path(self) -> bool:
        """True if there is an unfinished path."""
        return self._follower is not None

    def advance(self, now: float, duration: float) -> PlantState:
        """Advance by a duration [s] from time `now` [s]; return the measurements."""
        if self._may_drive(now):
            self.steering = self._steer(now)
        else:  # no time passes for the follower, which knows no reason to stand but being stuck
            self.steering, self._held = (0.0, 0.0), self._held + duration
        if self._parameters.follow_commands:
            fresh = now - self._torques_at <= self._parameters.timeout
            if fresh and not self._brakes:
                self.plant.pull(self._torques, self.steering, duration)
            else:  # drives without commands are off, and braked
                self.plant.brake(duration)
        else:
            self.plant.drive(*self.steering, duration)
        return self.plant.state()

    def _steer(self, now: float) -> tuple[float, float]:
        if self._follower is not None:
            pose = self.plant.pose()
            speed = self._parameters.speed or self.rover.nominal_speed
            wanted = self._follower.steer(pose, speed, now - self._held)
            if self._follower.has_arrived(pose):
                self._follower, self.at_end = None, True
            return wanted
        return self._wanted if self.has_speeds(now) else (0.0, 0.0)

    def look(self, position: Floats, yaw: float) -> Terrain:
        """Return the sensor's map of the ground around a rover; another thread may look.

        Args:
            position: (3,) body origin [m].
            yaw: Heading [rad].
        """
        return look(self._parameters, self.terrain, position, yaw, self._rng)
