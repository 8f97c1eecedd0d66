# SPDX-License-Identifier: Apache-2.0
"""Writes a rover as URDF: links with inertias, joints with limits, collision cylinders."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of
from rover_physics.names import SIDES, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator, Rover
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


def write_urdf(path: Path, rover: Rover) -> None:
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
    top = ElementTree.Element("robot", name=rover.name)
    # MuJoCo: keeps links that are fixed to another one, and what is only seen.
    extension = ElementTree.SubElement(top, "mujoco")
    ElementTree.SubElement(extension, "compiler", fusestatic="false", discardvisual="false")
    _Writer(top, rover).write()
    ElementTree.indent(top)
    text = ElementTree.tostring(top, encoding="unicode", xml_declaration=False)
    with errors_of(path):
        write_file(path, f'<?xml version="1.0"?>\n{text}\n'.encode())


class _Writer:
    """Appends the links and joints of a rover to a robot element."""

    def __init__(self, top: ElementTree.Element, rover: Rover):
        self._top, self._rover = top, rover

    def write(self) -> None:
        """Append everything."""
        self._body()
        for side in SIDES:
            self._side(side)
        if self._rover.manipulator is not None:
            self._arm(self._rover.manipulator)

    def _body(self) -> None:
        """Append the body without its arm, with the belly as a box."""
        rover = self._rover
        mass, com = rover.masses.body.mass, np.array(rover.masses.body.com)
        if rover.manipulator is not None:
            mass, com = _without_arm(mass, com, rover.manipulator)
        belly = rover.belly
        low = np.array([belly.x[0], belly.y[0], belly.z])
        height = max(BAR, 2.0 * (com[2] - belly.z))
        high = np.array([belly.x[1], belly.y[1], belly.z + height])
        link = self._link(ROOT, mass, com, high - low)
        for use in ("visual", "collision"):
            _box(link, use, low, high)

    def _side(self, side: str) -> None:
        """Append rocker, bogie and wheels of a side."""
        rover, mirror = self._rover, np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
        suspension, masses = rover.suspension, rover.masses
        rocker, bogie = mirror * suspension.rocker_pivot, mirror * suspension.bogie_pivot
        wheels = {name: mirror * place for name, place in suspension.wheels.items()}
        hung = [wheels[name] for name in suspension.bogie_wheels]
        alone = suspension.rocker_wheel
        rocker_name, bogie_name = f"rocker_{side}", f"bogie_{side}"
        self._frame(rocker_name, masses.rocker.mass, mirror * masses.rocker.com, rocker,
                    [bogie, wheels[alone]])  # fmt: skip
        self._frame(bogie_name, masses.bogie.mass, mirror * masses.bogie.com, bogie, hung)
        joint = self._joint(rocker_name, ROOT, rocker_name, rocker, Y)
        _limit(joint, suspension.rocker_limits, PASSIVE, PIVOT_SPEED)
        if side == "left":
            ElementTree.SubElement(
                joint, "mimic", joint="rocker_right", multiplier="-1", offset="0"
            )
        joint = self._joint(bogie_name, rocker_name, bogie_name, bogie - rocker, Y)
        _limit(joint, suspension.bogie_limits, PASSIVE, PIVOT_SPEED)
        self._wheel(f"{alone}_{side}", rocker_name, wheels[alone] - rocker)
        for name in suspension.bogie_wheels:
            self._wheel(f"{name}_{side}", bogie_name, wheels[name] - bogie)

    def _frame(
        self, name: str, mass: float, com: Floats, pivot: Floats, ends: Sequence[Floats]
    ) -> None:
        """Append a rocker or bogie: a bar from its pivot to each end; positions in the body."""
        points = np.array([pivot, *ends])
        link = self._link(name, mass, com - pivot, np.ptp(points, axis=0))
        for end in ends:
            _bar(link, np.zeros(3), end - pivot, 0.5 * BAR)

    def _wheel(self, name: str, parent: str, place: Floats) -> None:
        """Append a wheel, with the link that steers it if it steers."""
        wheel, steering = self._rover.wheel, self._rover.steering
        mass, joint_name = wheel.mass, f"{name}_steering"
        size = np.array([2.0 * wheel.radius, wheel.width, 2.0 * wheel.radius])
        if steering is not None and joint_name in steering_joints(self._rover):
            self._link(joint_name, STEERING_SHARE * mass, np.zeros(3), size)
            joint = self._joint(joint_name, parent, joint_name, place, Z)
            # The rover file has no torque of the steering drives: that of the wheels stands here.
            _limit(joint, (-steering.limit, steering.limit), wheel.max_torque, steering.rate)
            parent, place, mass = joint_name, np.zeros(3), mass - STEERING_SHARE * mass
        across = max(mass, MIN_LINK_MASS) * (3.0 * wheel.radius**2 + wheel.width**2) / 12.0
        along = 0.5 * max(mass, MIN_LINK_MASS) * wheel.radius**2
        link = self._link(name, mass, np.zeros(3), size, np.array([across, along, across]))
        for use in ("visual", "collision"):
            _cylinder(link, use, wheel.radius, wheel.width, ("0 0 0", ALONG_Y))
        joint = self._joint(f"{name}_wheel", parent, name, place, Y, "continuous")
        _limit(joint, None, wheel.max_torque, wheel.max_speed)

    def _arm(self, arm: Manipulator) -> None:
        """Append the arm: column, two links along x, and the tip with its payload."""
        points = link_points(arm, np.zeros(3))
        parent, place = ROOT, points[0]
        for k, (joint_name, axis) in enumerate(zip(arm.joints, (Z, Y, Y), strict=True)):
            step = points[k + 1] - points[k]
            link = self._link(joint_name, arm.link_masses[k], 0.5 * step, np.abs(step))
            _bar(link, np.zeros(3), step, 0.5 * BAR)
            kind = "continuous" if arm.joint_limits is None else "revolute"
            joint = self._joint(joint_name, parent, joint_name, place, axis, kind)
            limits = None if arm.joint_limits is None else arm.joint_limits[k]
            _limit(joint, limits, PASSIVE, PIVOT_SPEED)
            parent, place = joint_name, step
        if arm.payload > 0.0:
            self._link(ARM_TIP, arm.payload, np.zeros(3), np.zeros(3))
        else:
            ElementTree.SubElement(self._top, "link", name=ARM_TIP)
        self._joint(ARM_TIP, parent, ARM_TIP, place, X, "fixed")

    def _link(
        self, name: str, mass: float, com: Floats, size: Floats, inertia: Floats | None = None
    ) -> ElementTree.Element:
        """Append a link; without `inertia` (3,) [kg m^2], that of a solid box of `size` [m]."""
        mass = max(mass, MIN_LINK_MASS)
        if inertia is None:
            squares = np.maximum(size, BAR) ** 2
            inertia = mass * (squares.sum() - squares) / 12.0
        link = ElementTree.SubElement(self._top, "link", name=name)
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=_text(com), rpy="0 0 0")
        ElementTree.SubElement(inertial, "mass", value=_text([mass]))
        moments = dict(zip(("ixx", "iyy", "izz"), map(repr, inertia.tolist()), strict=True))
        ElementTree.SubElement(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
        return link

    def _joint(
        self,
        name: str,
        parent: str,
        child: str,
        place: Floats,
        axis: Floats,
        kind: str = "revolute",
    ) -> ElementTree.Element:
        """Append a joint without its limits."""
        joint = ElementTree.SubElement(self._top, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "origin", xyz=_text(place), rpy="0 0 0")
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        if kind != "fixed":
            ElementTree.SubElement(joint, "axis", xyz=_text(axis))
        return joint


def _without_arm(mass: float, com: Floats, arm: Manipulator) -> tuple[float, Floats]:
    """Return mass and centre of mass of the body without its stowed arm."""
    points, moment = link_points(arm, np.array(arm.stowed)), mass * com
    for k, link_mass in enumerate(arm.link_masses):
        moment = moment - link_mass * 0.5 * (points[k] + points[k + 1])
    rest = mass - sum(arm.link_masses)
    return rest, moment / rest


def _limit(
    joint: ElementTree.Element, limits: tuple[float, float] | None, effort: float, velocity: float
) -> None:
    """Append the limits of a joint."""
    ends = {} if limits is None else {"lower": _text(limits[:1]), "upper": _text(limits[1:])}
    ElementTree.SubElement(
        joint, "limit", ends, effort=_text([effort]), velocity=_text([velocity])
    )


def _box(link: ElementTree.Element, use: str, low: Floats, high: Floats) -> None:
    """Append a box between two corners, in the link's frame."""
    part = ElementTree.SubElement(link, use)
    ElementTree.SubElement(part, "origin", xyz=_text(0.5 * (low + high)), rpy="0 0 0")
    ElementTree.SubElement(ElementTree.SubElement(part, "geometry"), "box", size=_text(high - low))


def _cylinder(
    link: ElementTree.Element, use: str, radius: float, length: float, place: tuple[str, str]
) -> None:
    """Append a cylinder at a place: xyz and rpy."""
    part = ElementTree.SubElement(link, use)
    ElementTree.SubElement(part, "origin", xyz=place[0], rpy=place[1])
    geometry = ElementTree.SubElement(part, "geometry")
    ElementTree.SubElement(geometry, "cylinder", radius=_text([radius]), length=_text([length]))


def _bar(link: ElementTree.Element, start: Floats, end: Floats, radius: float) -> None:
    """Append a round bar that is only seen, between two points of the link's frame."""
    step = end - start
    length = float(np.linalg.norm(step))
    if length < radius:
        return
    pitch = np.arctan2(np.hypot(step[0], step[1]), step[2])
    rpy = np.array([0.0, pitch, np.arctan2(step[1], step[0])])
    _cylinder(link, "visual", radius, length, (_text(0.5 * (start + end)), _text(rpy)))


def _text(numbers: Sequence[float] | Floats) -> str:
    """Return numbers in full, with blanks between them."""
    return " ".join(repr(float(number)) for number in numbers)
