# SPDX-License-Identifier: Apache-2.0
"""Forces of a wheel that spins in place in MuJoCo: its load hops, its traction is below mu N.

Run from the repository: python -m benchmarks.spinning_wheel [--picture FILE]
It needs the extra `bench`.
"""

import itertools
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
import typer

from benchmarks.measure import print_table
from rover_planner.simulator.mujoco_rover import TIMESTEP

MODEL = """
<mujoco>
  <option timestep="{timestep}" integrator="implicitfast" cone="elliptic" impratio="20"
    iterations="50" tolerance="1e-10"/>
  <default>
    <geom friction="{friction} 0 0" condim="3" solref="{contact_time} 1"
      solimp="0.97 0.995 0.0005"/>
  </default>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body pos="0 0 0.1">
      <joint type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1.38" diaginertia="0.01 0.01 0.01"/>
      <body>
        <joint name="wheel" type="hinge" axis="0 1 0" armature="0.0138"/>
        <geom type="cylinder" size="0.1 0.04" euler="90 0 0" mass="0.35"/>
      </body>
    </body>
  </worldbody>
  <actuator><velocity joint="wheel" kv="40"/></actuator>
</mujoco>
"""
"""A wheel of the LSR-1 with its share of the rover, free to move up and down only; contacts as in
rover_planner/simulator/mujoco_model.py."""
FRICTIONS, SLIPS, TIMESTEPS = (0.5, 0.9), (0.005, 0.02, 0.08), (TIMESTEP, 0.001)
"""Friction coefficients, sliding speeds of the tread [m/s] and steps of the simulation [s]."""
DURATION, START = 4.0, 1.0
"""Time that is simulated, and from which on forces count [s]."""


def spin(friction: float, slip: float, timestep: float = TIMESTEP) -> np.ndarray:
    """Return loads and tractions (steps, 2) [N] of a wheel that spins in place."""
    text = MODEL.format(timestep=timestep, friction=friction, contact_time=2.5 * timestep)
    model = mujoco.MjModel.from_xml_string(text)
    data, forces, contact = mujoco.MjData(model), [], np.zeros(6)
    data.ctrl[0] = slip / 0.1
    while data.time < DURATION:
        mujoco.mj_step(model, data)
        total = np.zeros(3)
        for k in range(data.ncon):
            mujoco.mj_contactForce(model, data, k, contact)
            total += data.contact[k].frame.reshape(3, 3).T @ contact[:3]
        forces.append((total[2], abs(total[0])))
    return np.array(forces)[round(START / timestep) :]


def main(picture: Annotated[Path | None, typer.Option(help="Picture to draw.")] = None) -> None:
    """Print mean traction over friction times mean load, and how much the load varies."""
    rows = []
    for timestep, friction, slip in itertools.product(TIMESTEPS, FRICTIONS, SLIPS):
        load, traction = spin(friction, slip, timestep).T
        share, scatter = traction.mean() / (friction * load.mean()), load.std() / load.mean()
        numbers = f"{timestep:g}", f"{friction:g}", f"{slip:g}", f"{share:.2f}", f"{scatter:.2f}"
        rows.append(numbers)
    headings = ("step [s]", "friction", "slip [m/s]", "traction over mu N", "load, std over mean")
    print_table("A wheel that spins in place", headings, rows)
    if picture is not None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.0, 3.0), layout="constrained")
        axes = figure.subplots()
        load, traction = spin(0.9, 0.08)[:100].T
        time = TIMESTEP * np.arange(len(load))
        axes.plot(time, load, label="load")
        axes.plot(time, traction, label="traction")
        axes.axhline(0.9 * spin(0.9, 0.08)[:, 0].mean(), color="k", ls=":", label="mu N, mean")
        axes.set_xlabel("time [s]")
        axes.set_ylabel("force [N]")
        axes.legend(frameon=False, loc="upper right")
        figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    typer.run(main)
