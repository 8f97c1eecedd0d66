# SPDX-License-Identifier: Apache-2.0
"""A robot from a URDF file: links and joints without meshes, and where they are in a posture."""

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

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
ORIGIN, X_AXIS = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
ABSENT = (math.nan,)
"""Stands for a number that must be there: an error if it is not."""

Element = ElementTree.Element


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
class Joint:
    """A connection of two links; limits are inf where the file sets none."""

    name: str
    """Its name."""
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
    lower: float = -math.inf
    """[rad] or [m]."""
    upper: float = math.inf
    """[rad] or [m]."""
    effort: float = math.inf
    """[N m] or [N]."""
    velocity: float = math.inf
    """[rad/s] or [m/s]."""


@dataclass(frozen=True)
class Robot:
    """The links and joints of a URDF file, a tree."""

    name: str
    """Name of the robot."""
    links: dict[str, Link]
    """Links by name."""
    joints: dict[str, Joint]
    """Joints by name."""

    @cached_property
    def carriers(self) -> dict[str, Joint]:
        """The joint that carries each link but the root."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def carried(self) -> dict[str, list[Joint]]:
        """The joints whose parent is a link, for each link from the root outwards."""
        hung: dict[str, list[Joint]] = {}
        for joint in self.joints.values():
            hung.setdefault(joint.parent, []).append(joint)
        order = [next(name for name in self.links if name not in self.carriers)]
        for link in order:
            order += [joint.child for joint in hung.get(link, ())]
        return {link: hung.get(link, []) for link in order}

    def joint(self, name: str) -> Joint:
        """Return a joint by its name.

        Raises:
            RoverFileError: There is no such joint.
        """
        if name not in self.joints:
            known = [other for other, joint in self.joints.items() if joint.kind in MOVING]
            raise RoverFileError(
                f"no joint {name!r} in the URDF; {suggest(name, known)}its moving joints are "
                f"{', '.join(known)}"
            )
        return self.joints[name]

    def joints_between(self, link: str, above: str) -> list[Joint]:
        """Return the joints between a link and one that it hangs on, the nearest first."""
        found = []
        while link != above and link in self.carriers:
            found.append(self.carriers[link])
            link = self.carriers[link].parent
        return found

    def links_on(self, joint: Joint) -> set[str]:
        """Return the names of all links that hang on a joint."""
        found = [joint.child]
        for link in found:
            found += [other.child for other in self.carried[link]]
        return set(found)

    def rigid_group(self, link: str) -> set[str]:
        """Return the links that move as one with a link: it, and all it is fixed to."""
        while link in self.carriers and self.carriers[link].kind == "fixed":
            link = self.carriers[link].parent
        found = [link]
        for name in found:
            found += [joint.child for joint in self.carried[name] if joint.kind == "fixed"]
        return set(found)


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
    robot = Robot(top.get("name", "rover"), links, joints)
    _check_tree(robot)
    return robot


def _read_link(element: Element) -> Link:
    """Return a link; a missing inertial means no mass."""
    name, weight = _name(element), element.find("inertial/mass")
    mass = 0.0 if weight is None else float(_numbers(weight, "value", name, ABSENT)[0])
    if mass < 0.0:
        raise RoverFileError(f"link {name}: mass is {mass:g}; it must not be negative")
    com = _read_place(element.find("inertial/origin"), name)[:3, 3]
    solids = [_read_solid(part, name) for part in element.findall("collision")]
    return Link(mass, com, tuple(solid for solid in solids if solid is not None))


def _read_solid(element: Element, link: str) -> Solid | None:
    """Return the box or cylinder of a collision element, None for a mesh or sphere."""
    place = _read_place(element.find("origin"), link)
    cylinder, box = element.find("geometry/cylinder"), element.find("geometry/box")
    if cylinder is not None:
        size = [_numbers(cylinder, key, link, ABSENT)[0] for key in ("radius", "length")]
        return Solid("cylinder", (float(size[0]), float(size[1])), place)
    if box is not None:
        return Solid("box", tuple(_numbers(box, "size", link, ORIGIN).tolist()), place)
    return None


def _read_joint(element: Element, links: dict[str, Link]) -> Joint:
    """Return a joint between links that exist; 0 as its torque or speed counts as not given."""
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
    axis = _numbers(element.find("axis"), "xyz", name, X_AXIS)
    length = float(np.linalg.norm(axis))
    if kind in MOVING and not length > 0.0:
        raise RoverFileError(f"joint {name}: axis is 0 0 0; it must have a direction")
    place, limit = _read_place(element.find("origin"), name), element.find("limit")
    limits: dict[str, Any] = {}
    for key in ("lower", "upper", "effort", "velocity") if limit is not None else ():
        value = float(_numbers(limit, key, name, (0.0,), math.inf)[0])
        value = value if abs(value) < UNLIMITED else math.copysign(math.inf, value)
        limits[key] = value if value or key in ("lower", "upper") else math.inf
    if kind == "continuous":
        limits |= {"lower": -math.inf, "upper": math.inf}
    parent, child = ends
    return Joint(name, kind, parent, child, place, axis / (length or 1.0), **limits)


def _read_place(origin: Element | None, name: str) -> Floats:
    """Return the (4, 4) pose of an origin."""
    place, rpy = np.eye(4), _numbers(origin, "rpy", name, ORIGIN)
    if rpy.any():
        place[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    place[:3, 3] = _numbers(origin, "xyz", name, ORIGIN)
    return place


def _numbers(
    element: Element | None,
    key: str,
    name: str,
    absent: tuple[float, ...],
    most: float = MAX_NUMBER,
) -> Floats:
    """Return the numbers of an attribute, each of at most `most` and at least its negative.

    There are as many as in `absent`, which holds where the attribute is absent.
    """
    text = None if element is None else element.get(key)
    try:
        numbers = np.array(absent if text is None else [float(word) for word in text.split()])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) != len(absent) or not (np.abs(numbers) <= most).all():
        must = "a number" if len(absent) == 1 else f"{len(absent)} numbers"
        raise RoverFileError(f"{name}: {key} is {describe(text)}; it must be {must}")
    return numbers


def _name(element: Element) -> str:
    name = element.get("name", "")
    if not name:
        raise RoverFileError(f"has a <{element.tag}> without a name")
    return name


def _check_tree(robot: Robot) -> None:
    """Check that all links hang on one."""
    children = Counter(joint.child for joint in robot.joints.values())
    twice = next((name for name, count in children.items() if count > 1), None)
    if twice is not None:
        raise RoverFileError(f"link {twice} hangs on two joints; a URDF is a tree")
    roots = sorted(robot.links.keys() - children)
    if len(roots) != 1:
        raise RoverFileError(
            f"has {len(roots)} links without a parent; a URDF has one ({', '.join(roots)})"
        )
    lost = sorted(robot.links.keys() - robot.carried.keys())
    if lost:
        raise RoverFileError(f"link {lost[0]} hangs on itself; a URDF is a tree")


class Posture:
    """A robot with its joints at angles; all positions are in one frame of choice."""

    def __init__(self, robot: Robot, angles: Mapping[str, float], rotation: Floats):
        """Place the links, the root at the origin.

        Args:
            robot: The robot.
            angles: Angles of joints by name [rad]; 0 for all others.
            rotation: (3, 3), turns vectors of the root link into the frame of choice.
        """
        self._robot = robot
        self._places: dict[str, Floats] = {}
        for link, joints in robot.carried.items():
            if not self._places:
                self._places[link] = np.eye(4)
                self._places[link][:3, :3] = rotation
            for joint in joints:
                place = _place_of(joint, angles.get(joint.name, 0.0))
                self._places[joint.child] = self._places[link] @ place

    def move(self, shift: Floats) -> None:
        """Move all by (3,) [m]."""
        for place in self._places.values():
            place[:3, 3] += shift

    def point(self, link: str) -> Floats:
        """Return the position (3,) of a link, and of the joint that carries it [m]."""
        return self._places[link][:3, 3]

    def axis(self, joint: Joint) -> Floats:
        """Return the axis (3,) of a joint, a unit vector."""
        return self._places[joint.child][:3, :3] @ joint.axis

    def masses(self, links: set[str]) -> Floats:
        """Return the mass of links [kg], and that times their centre of mass [kg m]: (4,)."""
        total = np.zeros(4)
        for name in sorted(links):
            link, place = self._robot.links[name], self._places[name]
            total += link.mass * np.append(1.0, place[:3, :3] @ link.com + place[:3, 3])
        return total

    def solids(self, links: set[str], kind: str) -> list[tuple[Solid, Floats]]:
        """Return the solids of a kind of links, each with its pose (4, 4) [m]."""
        return [
            (solid, self._places[name] @ solid.place)
            for name in sorted(links)
            for solid in self._robot.links[name].solids
            if solid.kind == kind
        ]


def _place_of(joint: Joint, angle: float) -> Floats:
    """Return the pose (4, 4) of a joint's child in its parent."""
    if angle == 0.0 or joint.kind not in MOVING:
        return joint.place
    turn = np.eye(4)
    if joint.kind == "prismatic":
        turn[:3, 3] = angle * joint.axis
    else:
        turn[:3, :3] = Rotation.from_rotvec(angle * joint.axis).as_matrix()
    return joint.place @ turn
