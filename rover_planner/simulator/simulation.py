"""What drives the plant: a path, commanded speeds, or torques from elsewhere; no ROS."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.errors import PlanningError
from rover_planner.simulator.path_follower import PathFollower
from rover_planner.simulator.plant import Plant, PlantState
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.simulator.range_sensor import RangeSensor
from rover_planner.worlds.mars_terrain import make_mars_terrain

Floats = NDArray[np.float64]
ENGINES = ("quasi_static", "mujoco")
MADE_SIZE, MADE_RESOLUTION = 24.0, 0.05
"""Of the terrain that is made where none is given [m]."""


@dataclass(frozen=True)
class SimulationSettings:
    """The parameters of a simulator, loaded and ready to use."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The true ground."""
    start: tuple[float, float, float]
    """x, y [m] and yaw [rad]."""
    engine: str
    """One of ENGINES."""
    friction: float | None
    """Coulomb friction instead of terrain's and rover's own."""
    soil: str | None
    """Soil where the terrain names none; None: Coulomb friction."""
    policy: str
    """How the rover's own servos share the traction, "equal" or "optimal"."""
    speed: float
    """Along a path [m/s]."""
    follow_commands: bool
    """Whether torques from elsewhere drive the wheels."""
    timeout: float
    """Age from which speeds and torques count no more [s]."""
    sensor: RangeSensor
    """What it sees of the ground."""
    seed: int
    """Of all noise."""


def settings_from_parameters(values: Mapping[str, Any]) -> SimulationSettings:
    """Load what the parameters of the simulator name.

    Args:
        values: All of the table `ROVER_SIMULATOR`, each already checked.

    Raises:
        RoverError: Rover or terrain cannot be loaded.
    """
    rover = load_rover(values["rover"])
    name = values["terrain_file"]
    if name:
        terrain = load_terrain(name)
    else:
        terrain = make_mars_terrain(values["seed"], MADE_SIZE, MADE_RESOLUTION)
    return SimulationSettings(
        rover=rover,
        terrain=terrain,
        start=(values["start_x"], values["start_y"], values["start_yaw"]),
        engine=values["engine"],
        friction=values["friction"] or None,
        soil=values["soil"] or None,
        policy=values["policy"],
        speed=values["speed"] or rover.nominal_speed,
        follow_commands=values["follow_commands"],
        timeout=values["timeout"],
        sensor=RangeSensor(
            values["sensor_range"],
            values["sensor_noise"],
            values["sensor_height"],
            values["sensor_occlusion"],
        ),
        seed=values["seed"],
    )


def make_plant(settings: SimulationSettings) -> Plant:
    """Make the plant that the settings name.

    Raises:
        PlanningError: MuJoCo is asked for and not installed or told what it has no use for, or
            the rover cannot start there.
        SoilError: No soil of that name.
    """
    if settings.engine != "mujoco":
        return QuasiStaticPlant(
            settings.rover, settings.terrain, settings.start,
            settings.friction, settings.policy, settings.soil,
        )  # fmt: skip
    if settings.soil is not None:
        raise PlanningError(f"soil is {settings.soil!r}; it must be empty with the engine mujoco")
    if settings.policy != "equal":
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
