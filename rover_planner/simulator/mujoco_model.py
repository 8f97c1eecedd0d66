# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo model of a rover on a terrain, as MJCF text."""

import math
from xml.sax.saxutils import quoteattr

import numpy as np

from rover_physics.names import SIDES, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Part, Rover
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.terrain.grid import Terrain

MOTOR_INERTIA = 1.0
"""Inertia of a geared motor at the wheel, over (wheel radius)^2 times a sixth of the mass."""
STEERING_FREQUENCY = 60.0
"""Natural frequency of a steering actuator with the inertia of a wheel's motor [rad/s]."""

GIVE = 0.005
"""Depth over which a contact becomes hard [wheel radii]."""
PIVOT_DAMPING = 0.01216
"""Damping of a pivot, over weight x wheel radius x sqrt(wheel radius / gravity)."""
LEAST_MASS = 1e-4
"""Least mass of a part, over that of the rover: MuJoCo refuses parts without mass."""

# MuJoCo's native collision code reverses some normals between cylinders and height fields.
_MODEL = """
<mujoco model={name}>
  <option timestep="{timestep}" gravity="0 0 -{gravity}" integrator="implicitfast" cone="elliptic"
    impratio="20" iterations="50" tolerance="1e-10">
    <flag nativeccd="disable"/>
  </option>
  <default>
    <geom friction="{friction} 0 0" condim="3" solref="{contact_time} 1"
      solimp="0.97 0.995 {give}"/>
  </default>
  <asset>
    <hfield name="ground" nrow="{rows}" ncol="{columns}" size="{half_x} {half_y} {height} 0.5"/>
  </asset>
  <worldbody>
    <geom name="ground" type="hfield" hfield="ground" pos="{middle_x} {middle_y} {lowest}"/>
    <body name="body">
      <freejoint/>
      {body}
      {sides}
    </body>
  </worldbody>
  <equality>
    <joint joint1="rocker_right" joint2="rocker_left" polycoef="0 -1 0 0 0"
      solref="{contact_time} 1" solimp="0.99 0.999 0.0005"/>
  </equality>
  <actuator>
    {motors}
  </actuator>
</mujoco>
"""


def write_model(rover: Rover, terrain: Terrain, friction: float, timestep: float) -> str:
    """Return the MJCF text of a rover on a terrain."""
    half = 0.5 * terrain.resolution * (np.array(terrain.elevation.shape[::-1]) - 1)
    rows, columns = thin_out(terrain.elevation).shape
    middle = np.array(terrain.origin) + half
    span = float(np.ptp(terrain.elevation))
    motors = [
        f'<motor name="{joint}" joint="{joint}" ctrllimited="false"/>' for joint in WHEEL_JOINTS
    ]
    stiffness = STEERING_FREQUENCY**2 * _motor_inertia(rover)
    motors += [
        f'<position name="{joint}" joint="{joint}" kp="{stiffness}" dampratio="1"/>'
        for joint in steering_joints(rover)
    ]
    return _MODEL.format(
        name=quoteattr(rover.name), timestep=timestep,
        contact_time=2.5 * timestep, give=GIVE * rover.wheel.radius,
        gravity=rover.gravity, friction=friction,
        rows=rows, columns=columns, half_x=half[0], half_y=half[1],
        height=span if span > 0.0 else 1.0, middle_x=middle[0], middle_y=middle[1],
        lowest=float(terrain.elevation.min()), body=_write_inertia(rover, rover.masses.body, 1.0),
        sides="\n".join(_write_side(rover, side) for side in SIDES), motors="\n".join(motors),
    )  # fmt: skip


def thin_out(elevation: Floats) -> Floats:
    """Drop redundant rows of ground that is uniform along y, which speeds up collision checks."""
    for factor in (20, 10, 5, 4, 2):
        if (len(elevation) - 1) % factor:
            continue
        kept = elevation[::factor]
        shares = (np.arange(len(elevation)) % factor / factor)[:, None]
        below = np.repeat(kept, factor, axis=0)[: len(elevation)]
        above = np.repeat(np.vstack([kept[1:], kept[-1:]]), factor, axis=0)[: len(elevation)]
        if np.allclose(below + shares * (above - below), elevation, rtol=0.0, atol=1e-9):
            return kept
    return elevation


def _write_side(rover: Rover, side: str) -> str:
    """Return the MJCF text of one side: rocker, bogie and wheels."""
    suspension, mirror = rover.suspension, -1.0 if side == "right" else 1.0
    wheels = {
        name: _write_wheel(rover, f"{name}_{side}", place, mirror)
        for name, place in suspension.wheels.items()
    }
    rocker, bogie = suspension.rocker_pivot, suspension.bogie_pivot
    damping = _pivot_damping(rover)
    hung = "\n".join(wheels[name] for name in suspension.bogie_wheels)
    # Positions are given in the body frame on flat ground, so each MJCF body has no offset.
    return f"""
      <body name="rocker_{side}">
        <joint name="rocker_{side}" type="hinge" axis="0 1 0" pos={_point(rocker, mirror)}
          damping="{damping}"/>
        {_write_inertia(rover, rover.masses.rocker, mirror)}
        {wheels[suspension.rocker_wheel]}
        <body name="bogie_{side}">
          <joint name="bogie_{side}" type="hinge" axis="0 1 0" pos={_point(bogie, mirror)}
            damping="{damping}"/>
          {_write_inertia(rover, rover.masses.bogie, mirror)}
          {hung}
        </body>
      </body>"""


def _write_wheel(rover: Rover, name: str, place: tuple[float, ...], mirror: float) -> str:
    """Return the MJCF text of a wheel; one that steers first turns about z of its link."""
    wheel, inertia = rover.wheel, _motor_inertia(rover)
    joint = f"{name}_steering"
    steering = f'<joint name="{joint}" type="hinge" axis="0 0 1" armature="{inertia}"/>'
    return f"""
          <body name="{name}" pos={_point(place, mirror)}>
            {steering if joint in steering_joints(rover) else ""}
            <joint name="{name}_wheel" type="hinge" axis="0 1 0" armature="{inertia}"/>
            <geom name="{name}" type="cylinder" size="{wheel.radius} {0.5 * wheel.width}"
              euler="90 0 0" mass="{wheel.mass}"/>
          </body>"""


def _motor_inertia(rover: Rover) -> float:
    """Return the inertia of a geared motor at a wheel [kg m^2]."""
    return MOTOR_INERTIA * rover.total_mass / 6.0 * rover.wheel.radius**2


def _pivot_damping(rover: Rover) -> str:
    """Return the damping of a pivot [N m s]; three digits: that of lsr1 is 0.01."""
    radius = rover.wheel.radius
    damping = PIVOT_DAMPING * rover.weight * radius * math.sqrt(radius / rover.gravity)
    return f"{damping:.3g}"


def _write_inertia(rover: Rover, part: Part, mirror: float) -> str:
    """Return the MJCF inertia of a part, taken as a sphere as large as a wheel."""
    mass = max(part.mass, LEAST_MASS * rover.total_mass)
    moment = 0.4 * mass * rover.wheel.radius**2
    return (
        f'<inertial pos={_point(part.com, mirror)} mass="{mass}" '
        f'diaginertia="{moment} {moment} {moment}"/>'
    )


def _point(place: tuple[float, ...], mirror: float) -> str:
    return f'"{place[0]} {mirror * place[1]} {place[2]}"'
