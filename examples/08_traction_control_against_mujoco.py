# SPDX-License-Identifier: Apache-2.0
"""Compares the same drive over rocks in MuJoCo with and without traction control.

MuJoCo simulates bodies, contacts and slip, and shares only the rover's numbers with the model of
this package. First each wheel has a speed servo. Then the traction controller shares the torques
by its quadratic program, as the node traction_controller does, from what a robot measures: joints,
attitude and rates. It sees no map. Needs the extra `bench`.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot

from rover_physics import Terrain, load_rover
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.simulator.mujoco_rover import MujocoRover
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.traction_service import TractionService

SPEED, PERIOD, START, END, FRICTION = 0.06, 0.02, -1.2, 0.8, 0.6  # m/s, s, m, m

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
random = np.random.default_rng(2)
x, y = np.meshgrid(np.arange(-2.0, 2.0, 0.02), np.arange(-0.8, 0.8, 0.02))
height = 0.0 * x
for _ in range(60):  # rocks of 2 to 7 cm
    rock_x, rock_y = random.uniform(-0.6, 1.6), random.uniform(-0.7, 0.7)
    top, width = random.uniform(0.02, 0.07), random.uniform(0.05, 0.12)
    dome = 1.0 - ((x - rock_x) ** 2 + (y - rock_y) ** 2) / width**2
    height = np.maximum(height, top * np.sqrt(np.maximum(dome, 0.0)))
ground = Terrain(height, 0.02, (-2.0, -0.8))


def drive(with_traction_control: bool) -> np.ndarray:
    """Return (n, 4): x [m], slip speed [m/s], torque [N m] (means of wheels), power [W]."""
    plant = MujocoRover(load_rover("lsr1"), ground, (START, 0.0, 0.0), FRICTION)
    service = TractionService(load_traction_settings(TractionControllerParameters()))
    rates, rows = np.full(6, SPEED / plant.rover.wheel.radius), []
    while plant.pose()[0] < END and plant.time < 2.0 * (END - START) / SPEED:
        if with_traction_control:
            now = plant.time
            service.take_joints(plant.joint_positions, plant.joint_velocities, now)
            service.take_attitude(*plant.attitude, plant.body_rates, now)
            service.take_command(SPEED, 0.0, now)
            torques = service.drive(now).torques
            plant.step(torques, PERIOD)
        else:
            torques = plant.servo(rates, PERIOD)
        slip, power = plant.measure_contacts().slip_speeds, torques * plant.wheel_rates
        rows.append((plant.pose()[0], slip.mean(), np.abs(torques).mean(), power.clip(0.0).sum()))
    return np.array(rows)


figure, axes = pyplot.subplots(2, 1, figsize=(8, 6), layout="constrained", sharex=True)
for name, with_traction_control in (("speed servos", False), ("traction control", True)):
    log = drive(with_traction_control)
    slip, _, energy = log[:, 1:].sum(axis=0) * PERIOD
    print(f"{name}: {'arrived' if log[-1, 0] >= END else f'stuck at {log[-1, 0]:.2f} m'}, "
          f"slid {100 * slip:.1f} cm, {log[:, 2].mean():.2f} N m, {energy:.1f} J")  # fmt: skip
    axes[0].plot(log[:, 0], 100 * np.cumsum(log[:, 1]) * PERIOD, label=name)
    axes[1].plot(log[:, 0], log[:, 2], linewidth=0.8)
axes[0].set(ylabel="slip of a wheel so far [cm]")
axes[1].set(xlabel="x [m]", ylabel="mean torque of a wheel [N m]")
axes[0].legend()
figure.savefig(folder / "08_traction.png")
