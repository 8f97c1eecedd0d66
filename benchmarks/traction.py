"""Wheel torques in closed loop: speed servos, equal torques and the programme, in MuJoCo.

Run from the repository: python benchmarks/traction.py [--quick] [--out FOLDER]
It needs the extra `bench`. docs/traction.md has what it says.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_physics.rover import Rover, load_rover
from rover_physics.terrain import Terrain
from rover_planner.mujoco_plant import RoverPlant
from rover_planner.parameters import TRACTION_CONTROLLER
from rover_planner.traction_service import TractionService, settings_from_parameters

TESTS = Path(__file__).resolve().parents[1] / "test"
sys.path.insert(0, str(TESTS))
from reference_drives import drive_ground  # noqa: E402

PERIOD = 0.02
SPEED = 0.06
"""Of the drives [m/s]: twice the rover's own, half as long to wait for."""
START, END = -1.2, 1.2
PATIENCE = 2.0
"""Times the way's duration after which a rover is stuck."""
TIPPED = 1.2
SERVO, EQUAL, MOTION, MAP = "servo", "equal", "optimal", "optimal, map"
CONTROLLERS = (SERVO, EQUAL, MOTION, MAP)


@dataclass(frozen=True)
class Obstacle:
    """One ground to drive over along +x."""

    kind: str
    """step, bump_one_side, ditch, slope or rocks."""
    size: float
    """Height or width [m], angle [deg], or seed of the rocks."""
    friction: float
    """Friction coefficient."""

    @property
    def label(self) -> str:
        """Kind, size and friction."""
        return f"{self.kind} {self.size:g}, mu {self.friction:g}"


@dataclass(frozen=True)
class Drive:
    """How a drive went; means are over time and wheels, from start to end or to where it stuck."""

    passed: bool
    """Whether the rover came to the end."""
    end: float
    """x of the body's origin at the end [m]."""
    duration: float
    """[s]"""
    mean_utilisation: float
    """Mean of the largest of the wheels' utilisations."""
    peak_utilisation: float
    """The same, 95th percentile."""
    slip: float
    """Way that a tread slid over the ground [m], mean of the wheels."""
    torque: float
    """Mean size of a wheel's torque [N m]."""
    torque_squared: float
    """Mean square of a wheel's torque [(N m)^2]."""
    energy: float
    """Mechanical work of the motors, without what they take back [J]."""


Controller = Callable[[RoverPlant], np.ndarray]


def make_controller(name: str, rover: Rover, obstacle: Obstacle, ground: Terrain) -> Controller:
    """Return a function that moves the plant on by a period and returns its torques."""
    if name == SERVO:
        rates = np.full(6, SPEED / rover.wheel.radius)
        return lambda plant: plant.servo(rates, PERIOD)
    values = {spec.name: spec.default for spec in TRACTION_CONTROLLER}
    values |= {"policy": "equal" if name == EQUAL else "optimal", "friction": obstacle.friction}
    service = TractionService(settings_from_parameters(values))
    if name == MAP:
        service.take_terrain(ground)

    def control(plant: RoverPlant) -> np.ndarray:
        now = plant.time
        service.take_joints(plant.joint_positions, plant.joint_velocities, now)
        service.take_attitude(*plant.attitude, plant.body_rates, now)
        service.take_command(SPEED, 0.0, now)
        service.take_odometry(plant.pose, 0.0, now)
        torques = service.update(now).torques
        plant.step(torques, PERIOD)
        return torques

    return control


def drive(obstacle: Obstacle, name: str, trace: list | None = None) -> Drive:
    """Drive the rover lsr1 over an obstacle under a controller; `trace` takes what it did."""
    rover, ground = load_rover("lsr1"), make_ground(obstacle)
    plant = RoverPlant(rover, ground, (START, 0.0, 0.0), obstacle.friction)
    control = make_controller(name, rover, obstacle, ground)
    sums, peaks = np.zeros(4), []
    while plant.time < PATIENCE * (END - START) / SPEED and plant.pose[0] < END:
        torques = control(plant)
        if plant.tilt > TIPPED or abs(plant.pose[1]) > 1.0:
            break
        contacts = plant.measure_contacts()
        sums[0] += contacts.slip_speeds.mean() * PERIOD
        sums[1] += np.abs(torques).mean() * PERIOD
        sums[2] += (torques**2).mean() * PERIOD
        sums[3] += np.clip(torques * plant.wheel_rates, 0.0, None).sum() * PERIOD
        held = contacts.loads > 0.02 * rover.weight / 6.0
        used = contacts.shears[held] / (obstacle.friction * contacts.loads[held])
        peaks.append(float(used.max(initial=0.0)))
        if trace is not None:
            trace.append((plant.time, plant.pose[0], *contacts.loads, *torques, peaks[-1]))
    return Drive(
        passed=bool(plant.pose[0] >= END),
        end=float(plant.pose[0]),
        duration=plant.time,
        mean_utilisation=float(np.mean(peaks)),
        peak_utilisation=float(np.percentile(peaks, 95)),
        slip=float(sums[0]),
        torque=float(sums[1] / plant.time),
        torque_squared=float(sums[2] / plant.time),
        energy=float(sums[3]),
    )


def make_ground(obstacle: Obstacle) -> Terrain:
    """Return the ground of an obstacle."""
    if obstacle.kind != "rocks":
        return drive_ground(obstacle.kind, obstacle.size)
    from rough_grounds import rocky

    return rocky(int(obstacle.size))
