"""What drives the plant: a path, commanded speeds, or torques from elsewhere; no ROS."""

from dataclasses import dataclass

import numpy as np

from rover_physics.names import EQUAL
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.errors import PlanningError
from rover_planner.parameters.rover_simulator import MUJOCO, RoverSimulatorParameters
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.simulator.plant import Plant, PlantState
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.simulator.range_sensor import RangeSensor
from rover_planner.worlds.mars_terrain import make_mars_terrain

MADE_SIZE, MADE_RESOLUTION = 24.0, 0.05
"""Side and cell size of the terrain that is made where none is given [m]."""


@dataclass(frozen=True)
class SimulationSettings:
    """The parameters of a simulator, loaded and ready to use."""

    rover: Rover
    """The rover that is simulated."""
    terrain: Terrain
    """The true ground."""
    start: tuple[float, float, float]
    """x, y [m] and yaw [rad] of the rover at the start."""
    engine: str
    """One of ENGINES."""
    friction: float | None
    """Coulomb friction of the ground; None: that of the terrain, or of the rover file."""
    soil: str | None
    """Soil where the terrain names none; None: Coulomb friction."""
    policy: str
    """How the rover's own servos share the traction, one of TORQUE_POLICIES."""
    speed: float
    """Speed along a path [m/s]."""
    follow_commands: bool
    """Whether torques from elsewhere drive the wheels."""
    timeout: float
    """Age from which speeds and torques are ignored [s]."""
    sensor: RangeSensor
    """What measures the ground."""
    seed: int
    """Seed of all noise."""


def load_simulation_settings(parameters: RoverSimulatorParameters) -> SimulationSettings:
    """Load the rover and load or make the terrain that the parameters name.

    Raises:
        RoverError: Rover or terrain cannot be loaded.
    """
    rover = load_rover(parameters.rover)
    if parameters.terrain_file:
        terrain = load_terrain(parameters.terrain_file)
    else:
        terrain = make_mars_terrain(parameters.seed, MADE_SIZE, MADE_RESOLUTION)
    return SimulationSettings(
        rover=rover,
        terrain=terrain,
        start=(parameters.start_x, parameters.start_y, parameters.start_yaw),
        engine=parameters.engine,
        friction=parameters.friction or None,
        soil=parameters.soil or None,
        policy=parameters.policy,
        speed=parameters.speed or rover.nominal_speed,
        follow_commands=parameters.follow_commands,
        timeout=parameters.timeout,
        sensor=RangeSensor(
            parameters.sensor_range,
            parameters.sensor_noise,
            parameters.sensor_height,
            parameters.sensor_occlusion,
        ),
        seed=parameters.seed,
    )


def make_plant(settings: SimulationSettings) -> Plant:
    """Make the plant that the settings name.

    Raises:
        PlanningError: MuJoCo is asked for and not installed or told what it has no use for, or
            the rover cannot start there.
        SoilError: No soil of that name.
    """
    if settings.engine != MUJOCO:
        return QuasiStaticPlant(
            settings.rover, settings.terrain, settings.start,
            settings.friction, settings.policy, settings.soil,
        )  # fmt: skip
    if settings.soil is not None:
        raise PlanningError(f"soil is {settings.soil!r}; it must be empty with the engine mujoco")
    if settings.policy != EQUAL:
        raise PlanningError(
            f"policy is {settings.policy!r}; it must be left out with the engine mujoco, whose "
            "servos hold speeds"
        )
    try:
        from rover_planner.simulator.mujoco_plant import MujocoPlant
    except ImportError:
        raise PlanningError(
            "engine is mujoco, which is not installed: pip install 'rover_planner[bench]'"
        ) from None
    return MujocoPlant(settings.rover, settings.terrain, settings.start, settings.friction)


class Simulation:
    """One rover, and what it was told last."""

    def __init__(self, settings: SimulationSettings):
        """Put the rover at its start.

        Raises:
            PlanningError: See `make_plant`, as for SoilError.
        """
        self.settings = settings
        self.plant = make_plant(settings)
        self._rng = np.random.default_rng(settings.seed)
        self._follower: PathFollower | None = None
        self._wanted, self._wanted_at = (0.0, 0.0), -np.inf
        self._torques, self._torques_at = np.zeros(6), -np.inf
        self.steering = (0.0, 0.0)
        """Speed [m/s] and yaw rate [rad/s] that path or command ask for."""

    def take_path(self, poses: Floats) -> None:
        """Follow poses (n, 3) from now on."""
        wheels = self.settings.rover.suspension.wheels
        self._follower = PathFollower(poses, 0.5 * (wheels["front"][0] - wheels["rear"][0]))

    def take_speeds(self, speed: float, yaw_rate: float, now: float) -> None:
        """Drive at a speed [m/s] and yaw rate [rad/s]; a path is given up for that."""
        self._follower = None
        self._wanted, self._wanted_at = (speed, yaw_rate), now

    def take_torques(self, torques: Floats, now: float) -> None:
        """Take torques (6,) [N m] in wheel order."""
        self._torques, self._torques_at = torques, now

    def has_speeds(self, now: float) -> bool:
        """Tell whether commanded speeds are in force: fresh, and no path is followed."""
        return self._follower is None and now - self._wanted_at <= self.settings.timeout

    @property
    def follows_path(self) -> bool:
        """Whether there is a path that is not done."""
        return self._follower is not None

    def advance(self, now: float, duration: float) -> PlantState:
        """Move on by a time [s] and return what can be measured."""
        self.steering = self._steer(now)
        speed, yaw_rate = self.steering
        if self.settings.follow_commands:
            fresh = now - self._torques_at <= self.settings.timeout
            self.plant.pull(self._torques if fresh else np.zeros(6), yaw_rate, duration)
        else:
            self.plant.drive(speed, yaw_rate, duration)
        return self.plant.state()

    def _steer(self, now: float) -> tuple[float, float]:
        if self._follower is not None:
            pose = self.plant.pose()
            wanted = self._follower.steer(pose, self.settings.speed)
            if self._follower.has_arrived(pose):
                self._follower = None
            return wanted
        return self._wanted if self.has_speeds(now) else (0.0, 0.0)

    def look(self) -> Terrain:
        """Return what the sensor sees of the ground around the rover."""
        position = self.plant.state().position
        return self.settings.sensor.look(self.settings.terrain, position, self._rng)
