# SPDX-License-Identifier: Apache-2.0
"""Writes a rover as URDF: links with inertias, joints with limits, collision cylinders."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of
from rover_physics.names import SIDES, SUSPENSION_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator, Part, Rover
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.rover.urdf.joint_map import ARM_TIP

STEERING_SHARE = 0.01
"""Share of a wheel's mass on the link that steers it; simulators refuse links of 0 kg."""
MIN_LINK_MASS = 1e-6
"""Mass of a moving link that has none in the rover file [kg]."""
BAR = 0.03
"""Smallest thickness of the boxes that inertias are computed for [m]."""
PASSIVE = 0.0
"""Effort of a joint without a drive."""
PIVOT_SPEED = 10.0
"""Velocity limit of a joint without a drive [rad/s]; URDF demands one."""
ROOT = "base_link"
"""Name of the body's link."""
OTHER_LINKS = (ROOT, *WHEELS, ARM_TIP)
"""Links without the name of their joint."""
X, Y, Z = np.eye(3)
ALONG_Y = "1.5707963267948966 0 0"
"""Roll, pitch, yaw that turn a cylinder's axis from z to y [rad]."""


def write_urdf(path: Path, rover: Rover, hardware: str = "") -> None:
    """Write a rover as URDF.

    The root link is ``base_link`` in the body frame, the joints have the names of the rover's
    joint messages, and angles of 0 are flat ground (the arm forward). ``rocker_left`` mimics
    ``rocker_right`` with the factor -1, which is the differential. Wheels collide as cylinders,
    the belly as a box. The file has no friction and no gravity.

    Inertias are those of solid cylinders (wheels) and of solid boxes around a link's joints
    (others), as a rover file has none. A steered wheel gives STEERING_SHARE of its mass to the
    link that steers it.

    Args:
        path: The file; an existing one is overwritten.
        rover: The rover.
        hardware: Plugin of ros2_control, such as mock_components/GenericSystem: the file then says
            which interfaces it has to have. Empty for none.

    Raises:
        RoverFileError: It cannot be written, or a joint of the arm has the name of a link.
    """
    arm = rover.manipulator
    taken = next((name for name in arm.joints if name in OTHER_LINKS), None) if arm else None
    if taken is not None:
        raise RoverFileError(
            f"manipulator.joints has {taken!r}, which is a link of the URDF; its links have the "
            "names of their joints: give this one another name"
        )
    links = [_body(rover), *(_side(rover, side) for side in SIDES)]
    if arm is not None:
        links.append(_arm(arm))
    if hardware:
        links.append(_interfaces(rover, hardware))
    top = ElementTree.fromstring(f"<robot name={quoteattr(rover.name)}>{''.join(links)}</robot>")
    ElementTree.indent(top)
    text = ElementTree.tostring(top, encoding="unicode", xml_declaration=False)
    with errors_of(path):
        write_file(path, f'<?xml version="1.0"?>\n{text}\n'.encode())


def _interfaces(rover: Rover, hardware: str) -> str:
    """Return the interfaces of all joints and of an IMU in the body for ros2_control."""

    def joint(name: str, *commands: str) -> str:
        kinds = [("command", one) for one in commands]
        kinds += [("state", one) for one in ("position", "velocity")]
        inside = "".join(f'<{kind}_interface name="{one}"/>' for kind, one in kinds)
        return f"<joint name={quoteattr(name)}>{inside}</joint>"

    joints = [joint(name) for name in SUSPENSION_JOINTS]
    joints += [joint(name, "effort", "velocity") for name in WHEEL_JOINTS]
    joints += [joint(name, "position") for name in steering_joints(rover)]
    measured = [f"orientation.{axis}" for axis in "xyzw"]
    measured += [f"{what}.{axis}" for what in ("angular_velocity", "linear_acceleration")
                 for axis in "xyz"]  # fmt: skip
    imu = "".join(f'<state_interface name="{name}"/>' for name in measured)
    return (
        f'<ros2_control name="rover" type="system"><hardware><plugin>{escape(hardware)}</plugin>'
        f'</hardware>{"".join(joints)}<sensor name="imu">{imu}</sensor></ros2_control>'
    )


def _body(rover: Rover) -> str:
    """Return the body without its arm, with the belly as a box."""
    mass, com, belly = rover.masses.body.mass, np.array(rover.masses.body.com), rover.belly
    if rover.manipulator is not None:
        mass, com = _without_arm(mass, com, rover.manipulator)
    low = np.array([belly.x[0], belly.y[0], belly.z])
    height = max(BAR, 2.0 * (com[2] - belly.z))
    high = np.array([belly.x[1], belly.y[1], belly.z + height])
    middle, box = 0.5 * (low + high), f'<box size="{_text(high - low)}"/>'
    shapes = _shape("visual", middle, box) + _shape("collision", middle, box)
    return _link(ROOT, mass, com, high - low, shapes)


def _side(rover: Rover, side: str) -> str:
    """Return rocker, bogie and wheels of a side."""
    mirror = np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
    suspension, masses = rover.suspension, rover.masses
    rocker, bogie = mirror * suspension.rocker_pivot, mirror * suspension.bogie_pivot
    wheels = {name: mirror * place for name, place in suspension.wheels.items()}
    hung = [wheels[name] for name in suspension.bogie_wheels]
    alone = suspension.rocker_wheel
    rocker_name, bogie_name = f"rocker_{side}", f"bogie_{side}"
    mimic = '<mimic joint="rocker_right" multiplier="-1" offset="0"/>' if side == "left" else ""
    passive = PASSIVE, PIVOT_SPEED
    parts = [
        _frame(rocker_name, masses.rocker, mirror, rocker, [bogie, wheels[alone]]),
        _frame(bogie_name, masses.bogie, mirror, bogie, hung),
        _joint(rocker_name, (ROOT, rocker_name), rocker, Y,
               _limit(suspension.rocker_limits, *passive) + mimic),
        _joint(bogie_name, (rocker_name, bogie_name), bogie - rocker, Y,
               _limit(suspension.bogie_limits, *passive)),
        _wheel(rover, f"{alone}_{side}", rocker_name, wheels[alone] - rocker),
    ]  # fmt: skip
    for name in suspension.bogie_wheels:
        parts.append(_wheel(rover, f"{name}_{side}", bogie_name, wheels[name] - bogie))
    return "".join(parts)


def _frame(name: str, part: Part, mirror: Floats, pivot: Floats, ends: Sequence[Floats]) -> str:
    """Return a rocker or bogie: a bar from its pivot to each end; positions in the body."""
    size = np.ptp(np.array([pivot, *ends]), axis=0)
    bars = "".join(_bar(end - pivot) for end in ends)
    return _link(name, part.mass, mirror * part.com - pivot, size, bars)


def _wheel(rover: Rover, name: str, parent: str, place: Floats) -> str:
    """Return a wheel, with the link that steers it if it steers."""
    wheel, steering, steered = rover.wheel, rover.steering, ""
    mass, joint_name = wheel.mass, f"{name}_steering"
    size = np.array([2.0 * wheel.radius, wheel.width, 2.0 * wheel.radius])
    if steering is not None and joint_name in steering_joints(rover):
        # The rover file has no torque of the steering drives: that of the wheels stands here.
        limit = _limit((-steering.limit, steering.limit), wheel.max_torque, steering.rate)
        steered = _link(joint_name, STEERING_SHARE * mass, np.zeros(3), size)
        steered += _joint(joint_name, (parent, joint_name), place, Z, limit)
        parent, place, mass = joint_name, np.zeros(3), mass - STEERING_SHARE * mass
    across = max(mass, MIN_LINK_MASS) * (3.0 * wheel.radius**2 + wheel.width**2) / 12.0
    along = 0.5 * max(mass, MIN_LINK_MASS) * wheel.radius**2
    inertia = np.array([across, along, across])
    cylinder = _cylinder(wheel.radius, wheel.width)
    shapes = "".join(_shape(use, "0 0 0", cylinder, ALONG_Y) for use in ("visual", "collision"))
    limit = _limit(None, wheel.max_torque, wheel.max_speed)
    link = _link(name, mass, np.zeros(3), size, shapes, inertia)
    return steered + link + _joint(f"{name}_wheel", (parent, name), place, Y, limit, "continuous")


def _arm(arm: Manipulator) -> str:
    """Return the arm: column, two links along x, and the tip with its payload."""
    points, parts = link_points(arm, np.zeros(3)), ""
    parent, place = ROOT, points[0]
    for k, (name, axis) in enumerate(zip(arm.joints, (Z, Y, Y), strict=True)):
        step = points[k + 1] - points[k]
        parts += _link(name, arm.link_masses[k], 0.5 * step, np.abs(step), _bar(step))
        kind = "continuous" if arm.joint_limits is None else "revolute"
        limits = None if arm.joint_limits is None else arm.joint_limits[k]
        limit = _limit(limits, PASSIVE, PIVOT_SPEED)
        parts += _joint(name, (parent, name), place, axis, limit, kind)
        parent, place = name, step
    if arm.payload > 0.0:
        parts += _link(ARM_TIP, arm.payload, np.zeros(3), np.zeros(3))
    else:
        parts += f'<link name="{ARM_TIP}"/>'
    return parts + _joint(ARM_TIP, (parent, ARM_TIP), place, None, "", "fixed")


def _link(
    name: str,
    mass: float,
    com: Floats,
    size: Floats,
    shapes: str = "",
    inertia: Floats | None = None,
) -> str:
    """Return a link; without `inertia` (3,) [kg m^2], that of a solid box of `size` [m]."""
    mass = max(mass, MIN_LINK_MASS)
    if inertia is None:
        squares = np.maximum(size, BAR) ** 2
        inertia = mass * (squares.sum() - squares) / 12.0
    ixx, iyy, izz = inertia.tolist()
    moments = f'ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"'
    return (
        f'<link name={quoteattr(name)}><inertial><origin xyz="{_text(com)}" rpy="0 0 0"/>'
        f'<mass value="{_text([mass])}"/><inertia {moments}/></inertial>{shapes}</link>'
    )


def _joint(
    name: str,
    ends: tuple[str, str],
    place: Floats,
    axis: Floats | None,
    limit: str,
    kind: str = "revolute",
) -> str:
    """Return a joint between a parent and a child link."""
    parent, child = map(quoteattr, ends)
    about = "" if axis is None else f'<axis xyz="{_text(axis)}"/>'
    return (
        f'<joint name={quoteattr(name)} type="{kind}"><origin xyz="{_text(place)}" rpy="0 0 0"/>'
        f"<parent link={parent}/><child link={child}/>{about}{limit}</joint>"
    )


def _without_arm(mass: float, com: Floats, arm: Manipulator) -> tuple[float, Floats]:
    """Return mass and centre of mass of the body without its stowed arm."""
    points, moment = link_points(arm, np.array(arm.stowed)), mass * com
    for k, link_mass in enumerate(arm.link_masses):
        moment = moment - link_mass * 0.5 * (points[k] + points[k + 1])
    rest = mass - sum(arm.link_masses)
    return rest, moment / rest


def _limit(limits: tuple[float, float] | None, effort: float, velocity: float) -> str:
    """Return the limits of a joint."""
    ends = "" if limits is None else f'lower="{_text(limits[:1])}" upper="{_text(limits[1:])}" '
    return f'<limit {ends}effort="{_text([effort])}" velocity="{_text([velocity])}"/>'


def _shape(use: str, place: Floats | str, geometry: str, rpy: Floats | str = "0 0 0") -> str:
    """Return what is seen or collides, at a place in the link's frame."""
    xyz, turn = (one if isinstance(one, str) else _text(one) for one in (place, rpy))
    origin = f'<origin xyz="{xyz}" rpy="{turn}"/>'
    return f"<{use}>{origin}<geometry>{geometry}</geometry></{use}>"


def _cylinder(radius: float, length: float) -> str:
    return f'<cylinder radius="{_text([radius])}" length="{_text([length])}"/>'


def _bar(step: Floats) -> str:
    """Return a round bar that is only seen, from the origin of the link; nothing if short."""
    length, radius = float(np.linalg.norm(step)), 0.5 * BAR
    if length < radius:
        return ""
    pitch = np.arctan2(np.hypot(step[0], step[1]), step[2])
    rpy = np.array([0.0, pitch, np.arctan2(step[1], step[0])])
    return _shape("visual", 0.5 * step, _cylinder(radius, length), rpy)


def _text(numbers: Sequence[float] | Floats) -> str:
    """Return numbers in full, with blanks between them."""
    return " ".join(repr(float(number)) for number in numbers)
