"""The rover in MuJoCo: it is dropped onto a height field and simulated until it is at rest."""

from dataclasses import dataclass

import mujoco
import numpy as np

from rover_physics.names import WHEELS
from rover_physics.numerics.quaternions import (
    forward_from_xyzw,
    wxyz_from_rpy,
    xyzw_from_wxyz,
)
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain

TIMESTEP = 1e-3
"""Time step [s]; with 2 ms or more the rover oscillates on contacts of this stiffness."""
DROP = 0.02
"""Initial clearance between the lowest wheel and the highest ground around the rover [m]."""
AT_REST = 1e-3
"""Speed [m/s, rad/s] of all degrees of freedom below which the rover counts as settled."""
LONGEST = 10.0
"""Simulated time after which a rover that still moves counts as not settled [s]."""
SIDES = (("right", -1.0), ("left", 1.0))


@dataclass(frozen=True)
class Settled:
    """A rover at rest."""

    pose: np.ndarray
    """(3,) x, y [m] and yaw [rad] at rest."""
    wheel_centres: np.ndarray
    """(6, 3) [m]."""
    steps: int
    """Number of time steps until it was at rest."""


class DroppedRover:
    """A rover above a terrain that can be dropped at any pose."""

    def __init__(self, rover: Rover, terrain: Terrain):
        self._rover, self._terrain = rover, terrain
        self._model = mujoco.MjModel.from_xml_string(describe(rover, terrain))
        low, high = terrain.elevation.min(), terrain.elevation.max()
        span = max(high - low, 1e-3)
        self._model.hfield_data[:] = ((terrain.elevation - low) / span).ravel()
        self._data = mujoco.MjData(self._model)
        wheels = [mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, w) for w in WHEELS]
        self._wheels = np.array(wheels)

    def settle(self, x: float, y: float, yaw: float) -> Settled | None:
        """Drop the level rover from just above the ground; return None if it does not settle."""
        model, data = self._model, self._data
        mujoco.mj_resetData(model, data)
        data.qpos[:3] = x, y, self._height_of_start(x, y)
        data.qpos[3:7] = wxyz_from_rpy(0.0, 0.0, yaw)
        still = 0
        for step in range(round(LONGEST / TIMESTEP)):
            mujoco.mj_step(model, data)
            still = still + 1 if np.abs(data.qvel).max() < AT_REST else 0
            if still * TIMESTEP >= 0.01 and step * TIMESTEP > 0.1:
                return self._describe(step + 1)
        return None

    def _height_of_start(self, x: float, y: float) -> float:
        """Return a height of the body [m] at which no wheel touches the ground."""
        terrain, suspension = self._terrain, self._rover.suspension
        reach = max(np.hypot(*wheel[:2]) for wheel in suspension.wheels.values())
        reach += 2.0 * self._rover.wheel.radius
        ny, nx = terrain.elevation.shape
        columns = np.abs(terrain.origin[0] + terrain.resolution * np.arange(nx) - x) < reach
        rows = np.abs(terrain.origin[1] + terrain.resolution * np.arange(ny) - y) < reach
        lowest = min(wheel[2] for wheel in suspension.wheels.values()) - self._rover.wheel.radius
        return float(terrain.elevation[np.ix_(rows, columns)].max()) - lowest + DROP

    def _describe(self, steps: int) -> Settled:
        forward_x, forward_y = forward_from_xyzw(xyzw_from_wxyz(self._data.qpos[3:7]))
        yaw = np.arctan2(forward_y, forward_x)
        pose = np.array([self._data.qpos[0], self._data.qpos[1], yaw])
        return Settled(pose, self._data.xpos[self._wheels].copy(), steps)


def describe(rover: Rover, terrain: Terrain) -> str:
    """Return the MJCF of a rover over a terrain, without the heights of the terrain.

    Rockers, bogies and wheels are connected by hinges. An equality constraint between the rocker
    angles models the differential. The wheels are braked, so that the rover does not roll away.
    """
    z, (x1, x2), (y1, y2) = rover.belly.z, rover.belly.x, rover.belly.y
    half = 0.5 * (x2 - x1), 0.5 * (y2 - y1), 0.04
    body = rover.masses.body
    sides = "".join(_describe_side(rover, side, sign) for side, sign in SIDES)
    return f"""
<mujoco>
  <option timestep="{TIMESTEP}" gravity="0 0 {-rover.gravity}" integrator="implicitfast"
    cone="elliptic" impratio="10"/>
  <compiler angle="radian" inertiafromgeom="false"/>
  <default>
    <geom condim="3" friction="0.8 0 0" solref="0.004 1" solimp="0.98 0.99 0.001 0.5 2"/>
    <joint armature="0.001" damping="0.05"/>
    <default class="wheel">
      <joint frictionloss="5" solreffriction="0.004 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
    </default>
  </default>
  <asset>{_describe_field(terrain)}</asset>
  <worldbody>
    <geom type="hfield" hfield="ground" {_place_of_field(terrain)}/>
    <body name="body">
      <freejoint/>
      {_inertial(body.mass, body.com, [m * body.mass for m in (0.02, 0.04, 0.05)])}
      <geom type="box" size="{_text(half)}" contype="0" conaffinity="0"
        pos="{_text((0.5 * (x1 + x2), 0.5 * (y1 + y2), z + 0.04))}"/>{sides}
    </body>
  </worldbody>
  <equality>
    <joint joint1="rocker_right" joint2="rocker_left" polycoef="0 -1 0 0 0" solref="0.004 1"/>
  </equality>
</mujoco>"""


def _describe_side(rover: Rover, side: str, sign: float) -> str:
    """Return the MJCF of one side: rocker, bogie and wheels."""
    suspension, masses = rover.suspension, rover.masses
    mirror = np.array([1.0, sign, 1.0])
    rocker_pivot = mirror * suspension.rocker_pivot
    bogie_pivot = mirror * suspension.bogie_pivot

    def wheel(name: str, pivot: np.ndarray) -> str:
        centre = mirror * suspension.wheels[name] - pivot
        size = rover.wheel.radius, 0.5 * rover.wheel.width
        inertia = 0.5 * rover.wheel.mass * size[0] ** 2
        return f"""
      <body name="{name}_{side}" pos="{_text(centre)}" childclass="wheel">
        <joint type="hinge" axis="0 1 0"/>
        {_inertial(rover.wheel.mass, (0, 0, 0), (0.5 * inertia, inertia, 0.5 * inertia))}
        <geom type="cylinder" size="{_text(size)}" zaxis="0 1 0"/>
      </body>"""

    bogie_wheels = "".join(wheel(name, bogie_pivot) for name in suspension.bogie_wheels)
    rocker_com = mirror * masses.rocker.com - rocker_pivot
    bogie_com = mirror * masses.bogie.com - bogie_pivot
    return f"""
    <body pos="{_text(rocker_pivot)}">
      <joint name="rocker_{side}" type="hinge" axis="0 1 0"/>
      {_inertial(masses.rocker.mass, rocker_com, (0.005, 0.005, 0.005))}
      {wheel(suspension.rocker_wheel, rocker_pivot)}
      <body pos="{_text(bogie_pivot - rocker_pivot)}">
        <joint type="hinge" axis="0 1 0"/>
        {_inertial(masses.bogie.mass, bogie_com, (0.005, 0.005, 0.005))}{bogie_wheels}
      </body>
    </body>"""


def _describe_field(terrain: Terrain) -> str:
    rows, columns = terrain.elevation.shape
    span = max(float(np.ptp(terrain.elevation)), 1e-3)
    half = 0.5 * terrain.resolution * np.array([columns - 1, rows - 1])
    size = _text((*half, span, 1.0))
    return f'<hfield name="ground" nrow="{rows}" ncol="{columns}" size="{size}"/>'


def _place_of_field(terrain: Terrain) -> str:
    xmin, xmax, ymin, ymax = terrain.bounds
    centre = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax), float(terrain.elevation.min())
    return f'pos="{_text(centre)}"'


def _inertial(mass: float, place, inertia) -> str:
    return f'<inertial mass="{mass}" pos="{_text(place)}" diaginertia="{_text(inertia)}"/>'


def _text(values) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)
