# SPDX-License-Identifier: Apache-2.0
"""Drives of the LSR-1 in MuJoCo, closed loop, over obstacles; they need the extra `bench`."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rich.progress import track

from benchmarks.grounds import Obstacle
from benchmarks.measure import console
from rover_physics import Rover, load_rover
from rover_physics.names import EQUAL, OPTIMAL
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.simulator.mujoco_rover import MAX_TILT, TIMESTEP, MujocoRover
from rover_planner.simulator.path_follower import PathFollower, SecondTry
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.traction_service import TractionService

PERIOD = 0.02
"""Period of the controllers [s]."""
SPEED = 0.06
"""Speed of the drives [m/s]: twice the rover's nominal speed, to halve the run time."""
START, END = -1.2, 1.2
"""x of the body's origin at the start and at the end of a drive [m]."""
LOOK_AHEAD = 0.5
"""Look-ahead distance of the path follower that steers [m]."""
MAX_OFFSET = 1.0
"""Distance from the x axis from which a rover counts as lost [m]."""
MIN_LOAD = 0.02
"""Load above which the utilisation of a wheel counts, in sixths of the weight."""
SERVO, DROOP, EQUAL_TORQUES = "servo", "servo with droop", "equal"
BY_MOTION, BY_MAP = "optimal", "optimal, map"
"""Controllers: speed servos with an integral part or with droop, equal torques, and the QP with
contact angles from motion or from the map."""


@dataclass(frozen=True)
class DriveResult:
    """Result of a drive; means are over time and wheels, up to the end or where it got stuck."""

    passed: bool
    """True if the rover reached the end."""
    end: float
    """x of the body's origin at the end [m]."""
    mean_utilisation: float
    """Mean over time of the largest friction utilisation of the six wheels."""
    slip: float
    """Distance that a tread slid over the ground [m], mean of the six wheels."""
    torque: float
    """Mean absolute wheel torque [N m]."""
    energy: float
    """Mechanical work of the motors [J]; negative power counts as zero."""


OBSTACLES = tuple(
    Obstacle(kind, size, friction, seed)
    for kind, rows in {
        "step": ((0.08, 0.6), (0.10, 0.8), (0.13, 0.8), (0.16, 1.0)),
        "bump_one_side": ((0.06, 0.4), (0.10, 0.6), (0.14, 0.8)),
        "ditch": ((0.12, 0.6), (0.30, 0.8), (0.60, 1.0)),
        "slope": ((15.0, 0.4), (20.0, 0.6), (25.0, 0.8)),
        "rocks": ((0.08, 0.4, 1), (0.08, 0.6, 2), (0.08, 0.8, 3), (0.08, 1.0, 4)),
        "relief": ((0.09, 0.4, 1), (0.09, 0.6, 2), (0.09, 0.8, 3)),
    }.items()
    for size, friction, seed in ((*row, 0)[:3] for row in rows)
)
"""Obstacles of the benchmarks: frictions from 0.4 to 1.0."""


def rover_of(obstacle: Obstacle) -> Rover:
    """Return the rover lsr1 at SPEED, with the torque limit of an obstacle."""
    rover = replace(load_rover("lsr1"), nominal_speed=SPEED)
    if obstacle.max_torque is None:
        return rover
    return replace(rover, wheel=replace(rover.wheel, max_torque=obstacle.max_torque))


def make_controller(
    name: str, plant: MujocoRover, obstacle: Obstacle
) -> Callable[[tuple[float, float], np.ndarray], np.ndarray]:
    """Return a function that advances the plant by PERIOD and returns its torques (6,) [N m].

    Its arguments are the commanded speed [m/s] and yaw rate [rad/s], and the rates (6,) of the
    wheels [rad/s] in the commanded motion.
    """
    if name == SERVO:
        return lambda _, rates: plant.servo(rates, PERIOD)
    if name == DROOP:
        droop = plant.rover.wheel.servo_droop
        return lambda _, rates: plant.servo_with_droop(rates, droop, PERIOD)
    values: dict[str, Any] = {"policy": EQUAL if name == EQUAL_TORQUES else OPTIMAL}
    if obstacle.max_torque is not None:
        values["max_torque"] = obstacle.max_torque
    parameters = TractionControllerParameters(friction=obstacle.friction, **values)
    service = TractionService(load_traction_settings(parameters))
    if name == BY_MAP:
        service.take_terrain(obstacle.ground)

    def control(command: tuple[float, float], _: np.ndarray) -> np.ndarray:
        now = plant.time
        service.take_joints(plant.joint_positions, plant.joint_velocities, now)
        service.take_attitude(*plant.attitude, plant.body_rates, now)
        service.take_command(*command, now)
        service.take_odometry(np.append(plant.position, plant.pose()[2]), 0.0, now)
        fault = service.find_fault(now)
        torques = (service.rest(fault) if fault else service.drive(now)).torques
        plant.step(torques, PERIOD)
        return torques

    return control


def follow_axis(
    plant: MujocoRover, obstacle: Obstacle, name: str, tries: int = 1, most_time: float = 2.0
) -> Iterator[np.ndarray]:
    """Drive along the x axis; yield the torques (6,) [N m] of each PERIOD, until END or lost.

    Args:
        plant: The rover, at START.
        obstacle: What the controller is told.
        name: The controller, such as SERVO.
        tries: Attempts at one place; a rover that stands still backs off before another one.
        most_time: Time after which a rover counts as stuck, as a multiple of the time at SPEED.
    """
    path = np.array([[START, 0.0, 0.0], [END + LOOK_AHEAD, 0.0, 0.0]])
    follower = SecondTry(PathFollower(path, LOOK_AHEAD), plant.rover.wheel.radius, tries)
    control = make_controller(name, plant, obstacle)
    while plant.time < most_time * (END - START) / SPEED and plant.pose()[0] < END:
        command = follower.steer(plant.pose(), SPEED, plant.time)
        torques = control(command, plant.steer(command) / plant.rover.wheel.radius)
        if plant.tilt > MAX_TILT or abs(plant.pose()[1]) > MAX_OFFSET or follower.given_up:
            return
        yield torques


def drive(
    obstacle: Obstacle,
    name: str,
    tries: int = 1,
    most_time: float = 2.0,
    timestep: float = TIMESTEP,
) -> DriveResult:
    """Drive the rover lsr1 over an obstacle, as `follow_axis`, with a time step of MuJoCo [s]."""
    rover = rover_of(obstacle)
    plant = MujocoRover(rover, obstacle.ground, (START, 0.0, 0.0), obstacle.friction, timestep)
    slip = torque = energy = 0.0
    peaks: list[float] = []
    for torques in follow_axis(plant, obstacle, name, tries, most_time):
        contacts = plant.measure_contacts()
        slip += contacts.slip_speeds.mean() * PERIOD
        torque += np.abs(torques).mean() * PERIOD
        energy += np.clip(torques * plant.wheel_rates, 0.0, None).sum() * PERIOD
        held = contacts.loads > MIN_LOAD * rover.weight / 6.0
        used = contacts.shears[held] / (obstacle.friction * contacts.loads[held])
        peaks.append(float(used.max(initial=0.0)))
    if not peaks:
        raise ValueError(f"the rover cannot stand at the start of {obstacle.label}")
    return DriveResult(
        passed=bool(plant.pose()[0] >= END),
        end=float(plant.pose()[0]),
        mean_utilisation=float(np.mean(peaks)),
        slip=float(slip),
        torque=float(torque / plant.time),
        energy=float(energy),
    )


def run_in_processes(function: Callable, jobs: Sequence[tuple]) -> Iterator:
    """Yield function(*job) for each job in order, from processes, one per core."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(mp_context=context) as pool:
        futures = [pool.submit(function, *job) for job in jobs]
        for future in track(futures, function.__name__, console=console(stderr=True)):
            yield future.result()
