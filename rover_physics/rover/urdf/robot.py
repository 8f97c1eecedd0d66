# SPDX-License-Identifier: Apache-2.0
"""A robot from a URDF file: links and joints without meshes, and where they are in a posture."""

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import read_regular_file
from rover_physics.files.validation import describe, errors_of, suggest
from rover_physics.numerics.arrays import Floats

MAX_BYTES = 10_000_000
"""Largest URDF file that is read."""
MAX_LINKS = 2000
"""Largest number of links, and of joints."""
UNLIMITED = 1e6
"""Limit of a joint [rad, m, N m, rad/s] from which on it counts as none."""
MAX_NUMBER = 1e9
"""Largest coordinate, size or mass [m, kg]."""
MOVING = ("revolute", "continuous", "prismatic")
KINDS = (*MOVING, "fixed", "floating", "planar")
X_AXIS = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Solid:
    """A box or cylinder of a link's collision geometry."""

    kind: str
    """``"box"`` or ``"cylinder"``."""
    size: tuple[float, ...]
    """Box: lengths along x, y, z [m]. Cylinder: radius and length along z [m]."""
    place: Floats
    """(4, 4) pose in the link's frame [m]."""


@dataclass(frozen=True)
class Link:
    """A rigid body."""

    mass: float
    """[kg]; 0 if the file has none."""
    com: Floats
    """(3,) centre of mass in the link's frame [m]."""
    solids: tuple[Solid, ...]
    """Collision geometry that is not a mesh."""


@dataclass(frozen=True)
class JointLimit:
    """Limits of a joint; inf where the file sets none."""

    lower: float = -math.inf
    """[rad] or [m]."""
    upper: float = math.inf
    """[rad] or [m]."""
    effort: float = math.inf
    """[N m] or [N]."""
    velocity: float = math.inf
    """[rad/s] or [m/s]."""


@dataclass(frozen=True)
class Joint:
    """A connection of two links."""

    kind: str
    """One of KINDS."""
    parent: str
    """Name of the parent link."""
    child: str
    """Name of the child link."""
    place: Floats
    """(4, 4) pose of the child in the parent's frame at angle 0 [m]."""
    axis: Floats
    """(3,) unit vector in the child's frame."""
    limit: JointLimit
    """Range, torque and speed."""


@dataclass(frozen=True)
class Robot:
    """The links and joints of a URDF file, a tree."""

    name: str
    """Name of the robot."""
    links: dict[str, Link]
    """Links by name."""
    joints: dict[str, Joint]
    """Joints by name."""
    root: str
    """Name of the link without a parent."""

    def joint_of(self, link: str) -> Joint | None:
        """Return the joint that carries a link, None for the root."""
        return next((joint for joint in self.joints.values() if joint.child == link), None)


def read_robot(path: Path) -> Robot:
    """Read a URDF file; xacro must be expanded before.

    Raises:
        RoverFileError: Unreadable, larger than MAX_BYTES, or as for `parse_robot`.
    """
    with errors_of(path):
        return parse_robot(read_regular_file(path, MAX_BYTES))


def parse_robot(text: bytes) -> Robot:
    """Return the robot of a URDF text.

    Raises:
        RoverFileError: Not XML, no URDF, a wrong number, or links that form no tree.
    """
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise RoverFileError("has a document type; a URDF file has none")
    try:
        top = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RoverFileError(f"is no XML: {error}") from None
    if top.tag != "robot":
        raise RoverFileError(f"is a <{top.tag}>; a URDF file is a <robot>")
    if any("xacro" in element.tag for element in top.iter()):
        raise RoverFileError("is xacro; expand it first: xacro FILE > OUT.urdf")
    for tag in ("link", "joint"):
        names = Counter(_name(element) for element in top.findall(tag))
        if len(names) > MAX_LINKS:
            raise RoverFileError(f"has {len(names)} <{tag}>; at most {MAX_LINKS} are read")
        twice = next((name for name, count in names.items() if count > 1), None)
        if twice is not None:
            raise RoverFileError(f"has two <{tag}> of the same name, {describe(twice)}")
    links = {_name(element): _read_link(element) for element in top.findall("link")}
    joints = {_name(element): _read_joint(element, links) for element in top.findall("joint")}
    return Robot(top.get("name", "rover"), links, joints, _find_root(links, joints))


def _read_link(element: ElementTree.Element) -> Link:
    """Return a link; a missing inertial means no mass."""
    inertial = element.find("inertial")
    mass, com = 0.0, np.zeros(3)
    if inertial is not None:
        weight = inertial.find("mass")
        mass = _number(weight, "value", _name(element)) if weight is not None else 0.0
        com = _read_place(inertial, _name(element))[:3, 3]
    if mass < 0.0:
        raise RoverFileError(f"link {_name(element)}: mass is {mass:g}; it must not be negative")
    solids = [_read_solid(part, _name(element)) for part in element.findall("collision")]
    return Link(mass, com, tuple(solid for solid in solids if solid is not None))


def _read_solid(element: ElementTree.Element, link: str) -> Solid | None:
    """Return the box or cylinder of a collision element, None for a mesh or sphere."""
    place = _read_place(element, link)
    cylinder, box = element.find("geometry/cylinder"), element.find("geometry/box")
    if cylinder is not None:
        size = _number(cylinder, "radius", link), _number(cylinder, "length", link)
        return Solid("cylinder", size, place)
    if box is not None:
        return Solid("box", tuple(_vector(box, "size", (0.0, 0.0, 0.0), link).tolist()), place)
    return None


def _read_joint(element: ElementTree.Element, links: dict[str, Link]) -> Joint:
    """Return a joint between links that exist."""
    name, kind = _name(element), element.get("type", "")
    if kind not in KINDS:
        raise RoverFileError(f"joint {name}: type is {kind!r}; it must be {', '.join(KINDS)}")
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        link = "" if end is None else end.get("link", "")
        if link not in links:
            raise RoverFileError(f"joint {name}: {tag} {link!r} is no link of this file")
        ends.append(link)
    axis = _vector(element.find("axis"), "xyz", X_AXIS, name)
    length = float(np.linalg.norm(axis))
    if kind in MOVING and not length > 0.0:
        raise RoverFileError(f"joint {name}: axis is 0 0 0; it must have a direction")
    place = _read_place(element, name)
    parent, child = ends
    return Joint(
        kind, parent, child, place, axis / (length or 1.0), _read_limit(element, name, kind)
    )


def _read_limit(element: ElementTree.Element, name: str, kind: str) -> JointLimit:
    """Return the limits of a joint; 0 as torque or speed counts as not given."""
    limit = element.find("limit")
    if limit is None:
        return JointLimit()

    def read(key: str, missing: float) -> float:
        value = missing if limit.get(key) is None else _number(limit, key, name, math.inf)
        return value if abs(value) < UNLIMITED else math.copysign(math.inf, value)

    lower, upper = read("lower", 0.0), read("upper", 0.0)
    if kind == "continuous":
        lower, upper = -math.inf, math.inf
    return JointLimit(
        lower, upper, read("effort", 0.0) or math.inf, read("velocity", 0.0) or math.inf
    )


def _read_place(element: ElementTree.Element, name: str) -> Floats:
    """Return the (4, 4) pose of an element's origin."""
    origin = element.find("origin")
    place = np.eye(4)
    rpy = _vector(origin, "rpy", (0.0, 0.0, 0.0), name)
    if rpy.any():
        place[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    place[:3, 3] = _vector(origin, "xyz", (0.0, 0.0, 0.0), name)
    return place


def _vector(
    element: ElementTree.Element | None, key: str, missing: tuple[float, ...], name: str
) -> Floats:
    """Return three numbers of an attribute."""
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(missing)
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != (3,) or not (np.abs(numbers) <= MAX_NUMBER).all():
        raise RoverFileError(f"{name}: {key} is {describe(text)}; it must be 3 numbers")
    return numbers


def _number(element: ElementTree.Element, key: str, name: str, most: float = MAX_NUMBER) -> float:
    """Return a number of an attribute, of at most `most` and at least its negative."""
    text = element.get(key)
    try:
        number = float(text or "")
    except ValueError:
        number = math.nan
    if not abs(number) <= most:
        raise RoverFileError(f"{name}: {key} is {describe(text)}; it must be a number")
    return number


def _name(element: ElementTree.Element) -> str:
    name = element.get("name", "")
    if not name:
        raise RoverFileError(f"has a <{element.tag}> without a name")
    return name


def _find_root(links: dict[str, Link], joints: dict[str, Joint]) -> str:
    """Return the link without a parent; all others must hang on it."""
    children = Counter(joint.child for joint in joints.values())
    twice = next((name for name, count in children.items() if count > 1), None)
    if twice is not None:
        raise RoverFileError(f"link {twice} hangs on two joints; a URDF is a tree")
    roots = links.keys() - set(children)
    if len(roots) != 1:
        raise RoverFileError(
            f"has {len(roots)} links without a parent; a URDF has one ({', '.join(sorted(roots))})"
        )
    return roots.pop()


@dataclass(frozen=True)
class Lump:
    """Mass of several links as one."""

    mass: float
    """[kg]."""
    moment: Floats
    """(3,) mass times centre of mass, in the frame of the tree [kg m]."""

    def __add__(self, other: "Lump") -> "Lump":
        """Return both as one."""
        return Lump(self.mass + other.mass, self.moment + other.moment)

    def __sub__(self, other: "Lump") -> "Lump":
        """Return this one without the other one."""
        return Lump(self.mass - other.mass, self.moment - other.moment)

    def com(self, missing: Floats) -> Floats:
        """Return the centre of mass (3,) [m]; `missing` if there is no mass."""
        return self.moment / self.mass if self.mass > 0.0 else missing


class JointTree:
    """A robot in one posture; all positions are in one frame of choice."""

    def __init__(self, robot: Robot, angles: Mapping[str, float], frame: Floats):
        """Place the links.

        Args:
            robot: The robot.
            angles: Angles of joints by name [rad]; 0 for all others.
            frame: (4, 4) pose of the root link in the frame of choice.
        """
        self.robot = robot
        self._children: dict[str, list[Joint]] = {}
        for joint in robot.joints.values():
            self._children.setdefault(joint.parent, []).append(joint)
        self._angles = {id(self.joint(name)): angle for name, angle in angles.items()}
        self._places: dict[str, Floats] = {robot.root: frame}
        self._order = [robot.root]
        for link in self._order:
            for joint in self._children.get(link, ()):
                self._places[joint.child] = self._places[link] @ self._place_of(joint)
                self._order.append(joint.child)
        lost = robot.links.keys() - self._places.keys()
        if lost:
            raise RoverFileError(f"link {sorted(lost)[0]} hangs on itself; a URDF is a tree")

    def joint(self, name: str) -> Joint:
        """Return a joint by its name.

        Raises:
            RoverFileError: There is no such joint.
        """
        if name not in self.robot.joints:
            known = [other for other, joint in self.robot.joints.items() if joint.kind in MOVING]
            raise RoverFileError(
                f"no joint {name!r} in the URDF; {suggest(name, known)}its moving joints are "
                f"{', '.join(known)}"
            )
        return self.robot.joints[name]

    def place(self, link: str) -> Floats:
        """Return the pose (4, 4) of a link [m]."""
        return self._places[link]

    def origin(self, joint: Joint) -> Floats:
        """Return the position (3,) of a joint [m]."""
        return self._places[joint.child][:3, 3]

    def axis(self, joint: Joint) -> Floats:
        """Return the axis (3,) of a joint, a unit vector."""
        return self._places[joint.child][:3, :3] @ joint.axis

    def joints_between(self, link: str, above: str) -> list[str]:
        """Return the names of the joints between a link and one that it hangs on."""
        names = {joint.child: name for name, joint in self.robot.joints.items()}
        found = []
        while link != above and link in names:
            found.append(names[link])
            link = self.robot.joints[names[link]].parent
        return found

    def links_on(self, joint: Joint) -> set[str]:
        """Return the names of all links that hang on a joint."""
        found = [joint.child]
        for link in found:
            found += [other.child for other in self._children.get(link, ())]
        return set(found)

    def lump(self, links: set[str]) -> Lump:
        """Return the mass of links as one."""
        total = Lump(0.0, np.zeros(3))
        for name in sorted(links):
            link, place = self.robot.links[name], self._places[name]
            total += Lump(link.mass, link.mass * (place[:3, :3] @ link.com + place[:3, 3]))
        return total

    def solids(self, links: set[str], kind: str) -> list[tuple[Solid, Floats]]:
        """Return the solids of a kind of links, each with its pose (4, 4) [m]."""
        return [
            (solid, self._places[name] @ solid.place)
            for name in sorted(links)
            for solid in self.robot.links[name].solids
            if solid.kind == kind
        ]

    def rigid_group(self, link: str) -> set[str]:
        """Return the links that move as one with a link: it, and all it is fixed to."""
        found = [link]
        for name in found:
            found += [
                joint.child
                for joint in self._children.get(name, ())
                if joint.kind == "fixed" and joint.child not in found
            ]
            above = self.robot.joint_of(name)
            if above is not None and above.kind == "fixed" and above.parent not in found:
                found.append(above.parent)
        return set(found)

    def _place_of(self, joint: Joint) -> Floats:
        """Return the pose (4, 4) of a joint's child in its parent."""
        angle = self._angles.get(id(joint), 0.0)
        if angle == 0.0 or joint.kind not in MOVING:
            return joint.place
        turn = np.eye(4)
        if joint.kind == "prismatic":
            turn[:3, 3] = angle * joint.axis
        else:
            turn[:3, :3] = Rotation.from_rotvec(angle * joint.axis).as_matrix()
        return joint.place @ turn
