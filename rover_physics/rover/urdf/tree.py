# SPDX-License-Identifier: Apache-2.0
"""Where the links of a robot are at given joint angles, and what hangs on a joint."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rover_physics.errors import RoverFileError
from rover_physics.files.validation import suggest
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.urdf.robot import MOVING, Joint, Robot, Solid


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


class Tree:
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
