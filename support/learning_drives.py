# SPDX-License-Identifier: Apache-2.0
"""Drives that the ground is learned from: up a plane and over soil by the model; CSV."""

from pathlib import Path

import numpy as np

from rover_physics import Rover, Terrain
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import rpy_from_xyzw
from rover_planner.learning import drive_log as log
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.simulator.simulation import Plant

RATE = 50.0
"""Rows per second."""
NAMES = [
    *("time", "x", "y", "yaw", "roll", "pitch", *SUSPENSION_JOINTS),
    *(f"{name}_rate" for name in WHEEL_JOINTS),
    *(f"{name}_torque" for name in WHEEL_JOINTS),
    *STEERING_JOINTS,
]
"""Columns of a CSV file, in the order of rows."""


def climb(rover: Rover, slope: float, seconds: float, speed: float = 0.06) -> Floats:
    """Return the rows of a rover that climbs the plane z = `slope` x, with grip, and noise.

    The torques hold it up, with different shares of the wheels.
    """
    time = np.arange(round(RATE * seconds)) / RATE
    rows = np.zeros((len(time), log.WIDTH))
    rows[:, log.STEERING.stop :] = np.nan
    angle = np.arctan(slope)
    rows[:, log.TIME], rows[:, log.X] = time, -0.5 * speed * seconds + speed * np.cos(angle) * time
    rows[:, log.PITCH] = -angle
    rows[:, log.RATES] = speed / rover.wheel.radius
    shares = np.array([1.3, 1.0, 0.7, 1.2, 1.0, 0.8])
    rows[:, log.TORQUES] = rover.weight * np.sin(angle) * rover.wheel.radius / 6.0 * shares
    scatter(rows, np.random.default_rng(0), 2e-4, 1e-3, 1e-3, 0.01, 1e-3)
    return rows


def scatter(rows: Floats, rng: np.random.Generator, *sigmas: float) -> None:
    """Add noise with standard deviations to place, attitude, suspension, torques and rates."""
    place, attitude = [log.X, log.Y], [log.YAW, log.ROLL, log.PITCH]
    measured = place, attitude, log.SUSPENSION, log.TORQUES, log.RATES
    for columns, sigma in zip(measured, sigmas, strict=True):
        rows[:, columns] += sigma * rng.standard_normal(rows[:, columns].shape)


def drive_over_soil(rover: Rover, ground: Terrain, soil: str, seconds: float) -> Floats:
    """Return rows of a drive along +x at the nominal speed in the quasi-static simulator."""
    plant, period, rows = QuasiStaticPlant(rover, ground, (-1.5, 0.0, 0.0), soil=soil), 0.1, []
    for step in range(round(seconds / period)):
        plant.drive(rover.nominal_speed, 0.0, period)
        if plant.state().stopped:
            break
        rows.append(row_of_plant(plant, (step + 1) * period))
    return np.array(rows).reshape(-1, log.WIDTH)


def row_of_plant(plant: Plant, time: float) -> Floats:
    """Return what is measured of a simulated rover at a time [s]."""
    state, row = plant.state(), np.full(log.WIDTH, np.nan)
    row[[log.TIME, log.X, log.Y, log.YAW]] = time, *plant.pose()
    row[[log.ROLL, log.PITCH]] = rpy_from_xyzw(state.orientation)[:2]
    row[log.SUSPENSION] = [state.joint_positions[name] for name in SUSPENSION_JOINTS]
    row[log.RATES] = [state.joint_velocities[name] for name in WHEEL_JOINTS]
    row[log.STEERING] = [state.joint_positions.get(name, 0.0) for name in STEERING_JOINTS]
    row[log.TORQUES] = state.wheel_torques
    return row


def write_csv(path: Path, rows: Floats, names: list[str] = NAMES) -> None:
    """Write rows as a CSV file, in an order of columns; NaN becomes an empty field."""
    lines = [",".join(names)]
    places = [NAMES.index(name) for name in names]
    for row in rows[:, places].tolist():
        lines.append(",".join("" if np.isnan(value) else f"{value:.6g}" for value in row))
    path.write_text("\n".join(lines) + "\n")
