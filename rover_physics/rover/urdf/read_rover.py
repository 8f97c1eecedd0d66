# SPDX-License-Identifier: Apache-2.0
"""Reads a rover from a URDF and a joint map: pivots, wheels, masses, drives and limits."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rover_physics.errors import RoverFileError
from rover_physics.files.validation import describe, errors_of
from rover_physics.names import SIDES, WHEEL_POSITIONS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator, Rover
from rover_physics.rover.rover_file import rover_from_dict
from rover_physics.rover.urdf.joint_map import ArmMap, UrdfJointMap, load_joint_map
from rover_physics.rover.urdf.robot import Joint, JointTree, Lump, Robot, Solid, read_robot

MAX_TILT = 0.02
"""Largest angle between a pivot or axle and the body's y axis [rad]."""
MAX_ROCKER_TILT = 0.25
"""Largest angle by which a rocker's pivot may rise or fall outwards [rad]."""
MAX_ASYMMETRY = 0.01
"""Largest distance between a point of the left side and the mirrored one of the right side [m]."""
DECIMALS = 12
"""Decimals of the numbers that are read, so that 0.1 in a URDF is 0.1 in a rover file."""
MIRROR = np.array([1.0, -1.0, 1.0])
ARM_TOLERANCE = 1e-3
"""Largest distance of a joint from where the arm's model has it [m]."""
LEVEL = 1e-6
"""Height difference of wheels that counts as none [m]."""
MAX_ANGLE = 0.1
"""Largest pitch or bogie angle that is made up for [rad]."""
STEP = 1e-6
"""Step of the differences that replace derivatives [rad]."""
ROUNDS = 20


@dataclass(frozen=True)
class Levelling:
    """Pitch of the axes and angle of the bogies of a URDF on level ground."""

    pitch: float = 0.0
    """Pitch of the axes of the URDF [rad], positive nose down; that of the body frame is 0."""
    bogie: float = 0.0
    """Angle of both bogies about y, beyond that of the map [rad]."""


NOT_LEVELLED = Levelling()


@dataclass(frozen=True)
class ReadRover:
    """A rover that was read from a URDF."""

    rover: Rover
    """The rover."""
    asymmetry: float
    """Largest distance between points of the left side and mirrored ones of the right [m]."""
    levelling: Levelling
    """Pitch of the axes and angle of the bogies of the URDF on level ground."""
    tilt: float
    """Largest angle between a rocker's pivot and y that is left out of account [rad]."""


def rover_from_urdf(urdf: Path, joint_map: Path) -> ReadRover:
    """Read a rover from a URDF file by a joint map.

    Geometry, masses, torques, speeds and joint limits are those of the URDF, both sides averaged;
    keys under `rover` of the map take precedence. Wheels that are not level at the angles of the
    map are brought onto level ground.

    Raises:
        RoverFileError: A file is unreadable or invalid, a joint of the map is missing or does not
            fit its part, or a key of the rover is neither in the URDF nor in the map.
    """
    robot, joints = read_robot(urdf), load_joint_map(joint_map)
    with errors_of(joint_map):
        _Reading(robot, joints).check()
        levelling = level_wheels(robot, joints)
        reading = _Reading(robot, joints, levelling)
        reading.check()
        contents = _merge(_rounded(reading.contents()), joints.rover)
    try:
        rover = rover_from_dict(contents, str(urdf))
    except RoverFileError as error:
        if "missing key" not in str(error):
            raise
        raise RoverFileError(
            f"{error}; the URDF does not tell it: write it under rover: in {joint_map}"
        ) from None
    return ReadRover(rover, reading.asymmetry, levelling, reading.tilt())


class _Reading:
    """A URDF with its links placed in the body frame."""

    def __init__(self, robot: Robot, joints: UrdfJointMap, levelling: Levelling = NOT_LEVELLED):
        stowed = (
            {}
            if joints.arm is None
            else dict(zip(joints.arm.joints, joints.arm.stowed, strict=True))
        )
        self._robot, self._joints = robot, joints
        self._angles = joints.angles | stowed
        self._frame = joints.axes.rotation()
        if levelling != NOT_LEVELLED:
            self._level(levelling)
        self._tree = JointTree(robot, self._angles, self._find_body_frame())
        self.asymmetry = 0.0
        """Largest distance found so far between both sides [m]."""
        tree = self._tree
        self._rockers = {side: tree.joint(joints.rocker[side]) for side in SIDES}
        self._bogies = {side: tree.joint(joints.bogie[side]) for side in SIDES}
        self._wheels = {wheel: tree.joint(joints.wheels[wheel]) for wheel in WHEELS}
        self._steering = {name: tree.joint(joint) for name, joint in joints.steering.items()}
        self._fixed = [tree.joint(joint) for joint in joints.fixed]
        self._on_rocker = {side: self._find_rocker(side) for side in SIDES}

    def _find_rocker(self, side: str) -> set[str]:
        """Return the links that hang on a rocker, of which some parts may hang on the body."""
        rocker, found = self._rockers[side], self._tree.links_on(self._rockers[side])
        wheels = {self._wheels[f"{position}_{side}"].child for position in WHEEL_POSITIONS}
        for joint in self._fixed:
            links = self._tree.links_on(joint)
            if joint.parent == rocker.parent and links & wheels:
                found |= links
        return found

    def contents(self) -> dict[str, Any]:
        """Return the keys of a rover file that the URDF gives; the others are left out."""
        found: dict[str, Any] = {"name": self._robot.name}
        found["wheel"] = self._wheel()
        found["suspension"] = self._suspension()
        found["masses"] = self._masses()
        belly = self._belly()
        if belly:
            found["belly"] = belly
        if self._steering:
            found["steering"] = self._steered()
        if self._joints.arm is not None:
            found["manipulator"] = _read_arm(self._tree, self._joints.arm)
        return found

    def wheel_heights(self) -> list[float]:
        """Return the heights of rear, middle and front wheels, means of both sides [m]."""
        return [
            0.5 * sum(float(self._wheel_centre(f"{position}_{side}")[2]) for side in SIDES)
            for position in WHEEL_POSITIONS
        ]

    def _level(self, levelling: Levelling) -> None:
        """Turn the body frame and the bogies."""
        tree = JointTree(self._robot, self._angles, _pose(self._frame))
        for name in self._joints.bogie.values():
            axis = tree.axis(tree.joint(name))
            turn = levelling.bogie if axis[1] > 0.0 else -levelling.bogie
            self._angles[name] = self._angles.get(name, 0.0) + turn
        self._frame = Rotation.from_euler("y", levelling.pitch).as_matrix() @ self._frame

    def _find_body_frame(self) -> Floats:
        """Return the pose (4, 4) of the root link in the body frame."""
        frame = _pose(self._frame)
        tree = JointTree(self._robot, self._angles, frame)
        points = [
            self._point_of(tree, side, tree.joint(self._joints.rocker[side])) for side in SIDES
        ]
        frame[:3, 3] = -0.5 * (points[0] + points[1])
        return frame

    def _point_of(self, tree: JointTree, side: str, joint: Joint) -> Floats:
        """Return the point (3,) of a joint's axis amid the wheels of a side [m].

        An origin may lie anywhere along its axis; the wheels turn about this point.
        """
        wheels = [self._joints.wheels[f"{position}_{side}"] for position in WHEEL_POSITIONS]
        y = np.mean([tree.origin(tree.joint(wheel))[1] for wheel in wheels])
        point, axis = tree.origin(joint).copy(), tree.axis(joint)
        if abs(axis[1]) > 0.5 and joint.kind != "fixed":
            point += (y - point[1]) / axis[1] * axis
        point[1] = y
        return point

    def tilt(self) -> float:
        """Return the largest angle between the pivot of a rocker and y [rad]."""
        axes = [self._tree.axis(one) for one in self._rockers.values() if one.kind != "fixed"]
        return max((_angle_to_y(axis) for axis in axes), default=0.0)

    def check(self) -> None:
        """Check that joints turn about y and hang on each other as those of a rover do.

        A rocker may be fixed, as in models for simulators that have no differential.
        """
        arm = self._joints.arm
        if arm is not None and arm.tip not in self._robot.links:
            raise RoverFileError(f"arm.tip: no link {describe(arm.tip)} in the URDF")
        for kind, joints in (("rocker", self._rockers), ("bogie", self._bogies),
                             ("wheels", self._wheels)):  # fmt: skip
            for part, joint in joints.items():
                key, name = f"{kind}.{part}", getattr(self._joints, kind)[part]
                axis = self._tree.axis(joint)
                if kind == "rocker" and joint.kind == "fixed":
                    continue
                if joint.kind not in ("revolute", "continuous"):
                    raise RoverFileError(f"{key}: joint {name} is {joint.kind}; it must turn")
                if kind != "wheels" and abs(axis[0]) > np.cos(MAX_TILT) and self._rolls():
                    raise RoverFileError(
                        f"{key}: joint {name} turns about x: a rover of three bogies has neither "
                        "rockers nor a differential; only rocker-bogies are read"
                    )
                rises = kind == "rocker" and abs(axis[0]) < np.sin(MAX_TILT)
                if _angle_to_y(axis) > (MAX_ROCKER_TILT if rises else MAX_TILT):
                    raise RoverFileError(
                        f"{key}: joint {name} turns about {np.round(axis, 3).tolist()}; it must "
                        "turn about y of the body frame (axes and angles of the map)"
                    )
        self._check_names()
        for side in SIDES:
            rocker, on_rocker = self._rockers[side], self._on_rocker[side]
            self._check_below(f"bogie.{side}", self._bogies[side], rocker, on_rocker)
            for position in WHEEL_POSITIONS:
                wheel = f"{position}_{side}"
                self._check_below(f"wheels.{wheel}", self._wheels[wheel], rocker, on_rocker)
                if wheel in self._steering:
                    steering = self._steering[wheel]
                    links = self._tree.links_on(steering)
                    self._check_below(f"wheels.{wheel}", self._wheels[wheel], steering, links)
                self._check_carriers(wheel, side)
            y = np.mean([self._wheel_centre(f"{one}_{side}")[1] for one in WHEEL_POSITIONS])
            if (y > 0.0) != (side == "left"):
                raise RoverFileError(
                    f"rocker.{side}: y is {y:.4g} m in the body frame, on the other side; sides "
                    "are exchanged, or axes.forward or axes.up is wrong"
                )

    def _rolls(self) -> bool:
        """Return whether all wheels turn about y."""
        return all(
            _angle_to_y(self._tree.axis(wheel)) <= MAX_TILT for wheel in self._wheels.values()
        )

    def _check_names(self) -> None:
        """Check that each joint is named once."""
        joints, found = self._joints, dict[str, str]()
        kinds = ("rocker", "bogie", "wheels", "steering")
        named = [(f"{kind}.{part}", name) for kind in kinds
                 for part, name in getattr(joints, kind).items()]  # fmt: skip
        named += [("fixed", name) for name in joints.fixed]
        named += [("arm.joints", name) for name in (joints.arm.joints if joints.arm else ())]
        for key, name in named:
            if name in found:
                raise RoverFileError(
                    f"{key}: joint {name} is named twice, as {found[name]}, too; a joint has one "
                    "part in the rover"
                )
            found[name] = key

    def _check_below(self, key: str, joint: Joint, above: Joint, links: set[str]) -> None:
        """Check that a joint hangs on another one, on which `links` do."""
        if joint.child == above.child or joint.child not in links:
            raise RoverFileError(
                f"{key}: its link {joint.child} does not hang on {above.child} in the URDF; where "
                "the parts of a rocker have joints of their own, name those under fixed"
            )

    def _check_carriers(self, wheel: str, side: str) -> None:
        """Check that nothing moves between rocker and wheel but bogie, steering and wheel."""
        moving = {self._joints.rocker[side], self._joints.bogie[side], self._joints.wheels[wheel]}
        moving |= {self._joints.steering.get(wheel, ""), *self._joints.fixed}
        chain = self._tree.joints_between(self._wheels[wheel].child, self._rockers[side].parent)
        for name in chain:
            kind = self._robot.joints[name].kind
            if kind != "fixed" and name not in moving:
                raise RoverFileError(
                    f"wheels.{wheel}: it hangs on joint {name}, which is {kind} and has no part "
                    "in the map: name it under steering, or under fixed if it does not move"
                )

    def _pivots(self, key: str, joints: dict[str, Joint]) -> list[float]:
        """Return a pivot of the left side; where along its axis an origin lies means nothing."""
        points = {side: self._point_of(self._tree, side, joints[side]) for side in SIDES}
        y = {side: self._tree.origin(joint)[1] for side, joint in joints.items()}
        if abs(y["left"] + y["right"]) <= MAX_ASYMMETRY:
            for side in SIDES:
                points[side][1] = y[side]
        return self._mean(("suspension", key), points)

    def _mean(self, key: tuple[str, ...], points: dict[str, Floats]) -> list[float]:
        """Return the mean of a point of the left side and the mirrored one of the right side.

        A point that the map gives under a key of the rover is that, whatever the URDF has.
        """
        given: Any = self._joints.rover
        for name in key:
            given = given.get(name) if isinstance(given, dict) else None
        if given is not None:
            return given
        left, right = points["left"], MIRROR * points["right"]
        apart = float(np.linalg.norm(left - right))
        self.asymmetry = max(self.asymmetry, apart)
        if apart > MAX_ASYMMETRY:
            raise RoverFileError(
                f"{'.'.join(key)}: left {np.round(left, 4).tolist()} and mirrored right "
                f"{np.round(right, 4).tolist()} are {apart:.3g} m apart; both sides of the rover "
                f"must be alike within {MAX_ASYMMETRY:g} m"
            )
        return (0.5 * (left + right)).tolist()

    def _wheel_centre(self, wheel: str) -> Floats:
        """Return the middle of a wheel's cylinder; without one, the origin of its joint [m]."""
        cylinders = self._cylinders(wheel)
        joint = self._wheels[wheel]
        return cylinders[0][1][:3, 3] if cylinders else self._tree.origin(joint)

    def _cylinders(self, wheel: str) -> list[tuple[Solid, Floats]]:
        return self._tree.solids(self._tree.links_on(self._wheels[wheel]), "cylinder")

    def _wheel(self) -> dict[str, float]:
        """Return size, mass and drive of the wheels."""
        found = {"mass": self._wheel_mass()}
        cylinders = [self._cylinders(wheel) for wheel in WHEELS]
        if all(cylinders):
            sizes = np.array([cylinder[0][0].size for cylinder in cylinders])
            if np.ptp(sizes, axis=0).max() > 1e-3:
                raise RoverFileError("wheels have cylinders of several sizes; all must be alike")
            found["radius"], found["width"] = sizes.mean(axis=0).tolist()
        joints = self._wheels.values()
        for key, of in (("max_torque", "effort"), ("max_speed", "velocity")):
            least = min(getattr(joint.limit, of) for joint in joints)
            if np.isfinite(least):
                found[key] = float(least)
        return found

    def _suspension(self) -> dict[str, Any]:
        """Return pivots, wheel centres and limits."""
        on_bogie = {
            position
            for position in WHEEL_POSITIONS
            for side in SIDES
            if self._wheels[f"{position}_{side}"].child in self._on_bogie(side)
        }
        alone = set(WHEEL_POSITIONS) - on_bogie
        if len(alone) != 1 or "middle" in alone:
            raise RoverFileError(
                f"wheels {', '.join(sorted(on_bogie)) or 'none'} hang on bogies; it must be the "
                "middle one and the front or the rear one"
            )
        found: dict[str, Any] = {
            "rocker_pivot": self._pivots("rocker_pivot", self._rockers),
            "bogie_pivot": self._pivots("bogie_pivot", self._bogies),
            "rocker_wheel": alone.pop(),
            "wheels": {
                position: self._mean(
                    ("suspension", "wheels", position),
                    {side: self._wheel_centre(f"{position}_{side}") for side in SIDES},
                )
                for position in WHEEL_POSITIONS
            },
        }
        for key, joints in (("rocker_limits", self._rockers), ("bogie_limits", self._bogies)):
            limits = [self._limits(joint) for joint in joints.values()]
            low, high = max(limit[0] for limit in limits), min(limit[1] for limit in limits)
            if np.isfinite([low, high]).all():
                found[key] = [float(low), float(high)]
        return found

    def _limits(self, joint: Joint) -> tuple[float, float]:
        """Return lowest and highest angle about body y, counted from flat ground [rad]."""
        name = next(name for name, other in self._robot.joints.items() if other is joint)
        flat, limit = self._angles.get(name, 0.0), joint.limit
        low, high = limit.lower - flat, limit.upper - flat
        return (low, high) if self._tree.axis(joint)[1] > 0.0 else (-high, -low)

    def _steered(self) -> dict[str, Any]:
        """Return the steered axles, their limit and rate."""
        axles = [
            position
            for position in WHEEL_POSITIONS
            if any(f"{position}_{side}" in self._steering for side in SIDES)
        ]
        for axle in axles:
            for side in SIDES:
                if f"{axle}_{side}" not in self._steering:
                    raise RoverFileError(
                        f"missing key steering.{axle}_{side}; both wheels of an axle steer"
                    )
        found: dict[str, Any] = {"wheels": axles}
        limits = [joint.limit for joint in self._steering.values()]
        reach = min(min(abs(limit.lower), abs(limit.upper)) for limit in limits)
        rate = min(limit.velocity for limit in limits)
        if np.isfinite(reach):
            found["limit"] = float(reach)
        if np.isfinite(rate):
            found["rate"] = float(rate)
        return found

    def _masses(self) -> dict[str, Any]:
        """Return body, rocker and bogie; what a wheel weighs beyond the lightest is its link's."""
        wheel_mass, tree = self._wheel_mass(), self._tree
        on_rockers = [self._on_rocker[side] for side in SIDES]
        body = tree.lump(set(self._robot.links) - on_rockers[0] - on_rockers[1])
        if self._joints.arm is not None:
            body = body - tree.lump({self._joints.arm.tip})
        parts: dict[str, dict[str, Lump]] = {"rocker": {}, "bogie": {}}
        for side, on_rocker in zip(SIDES, on_rockers, strict=True):
            on_bogie = self._on_bogie(side)
            parts["rocker"][side] = tree.lump(on_rocker - on_bogie)
            parts["bogie"][side] = tree.lump(on_bogie)
            for position in WHEEL_POSITIONS:
                wheel = f"{position}_{side}"
                part = "bogie" if self._wheels[wheel].child in on_bogie else "rocker"
                point = Lump(wheel_mass, wheel_mass * self._wheel_centre(wheel))
                parts[part][side] = parts[part][side] - point
        pivots = {"rocker": self._rockers, "bogie": self._bogies}
        found: dict[str, Any] = {
            "body": {"mass": body.mass, "com": body.com(np.zeros(3)).tolist()}
        }
        for name, lumps in parts.items():
            mass = 0.5 * (lumps["right"].mass + lumps["left"].mass)
            found[name] = {
                "mass": mass if mass > 1e-12 else 0.0,
                "com": self._mean(
                    ("masses", name, "com"),
                    {side: lumps[side].com(tree.origin(pivots[name][side])) for side in SIDES},
                ),
            }
        return found

    def _wheel_mass(self) -> float:
        """Return the mass of the lightest wheel with what steers it [kg]."""
        lumps = [
            self._tree.lump(self._tree.links_on(self._steering.get(wheel, self._wheels[wheel])))
            for wheel in WHEELS
        ]
        return min(lump.mass for lump in lumps)

    def _on_bogie(self, side: str) -> set[str]:
        return self._tree.links_on(self._bogies[side])

    def _belly(self) -> dict[str, Any]:
        """Return the underside of the lowest box of the body; nothing if there is none."""
        links = self._tree.rigid_group(self._rockers["right"].parent)
        links -= self._on_rocker["right"] | self._on_rocker["left"]
        boxes = [_bounds(*box) for box in self._tree.solids(links, "box")]
        if not boxes:
            return {}
        low, high = min(boxes, key=lambda box: box[0][2])
        return {"z": low[2], "x": [low[0], high[0]], "y": [low[1], high[1]]}


def level_wheels(robot: Robot, joints: UrdfJointMap) -> Levelling:
    """Find the pitch and the bogie angle at which all wheels are level.

    Returns:
        No angles where the wheels are level as the URDF has them.

    Raises:
        RoverFileError: There are none within MAX_ANGLE.
    """

    def find_heights(angles: Floats) -> list[float]:
        return _Reading(robot, joints, Levelling(*angles.tolist())).wheel_heights()

    def differ(angles: Floats) -> Floats:
        rear, middle, front = find_heights(angles)
        return np.array([middle - rear, front - rear])

    angles = np.zeros(2)
    for _ in range(ROUNDS):
        off = differ(angles)
        if np.abs(off).max() <= LEVEL * 1e-3:
            break
        if not angles.any() and np.abs(off).max() <= LEVEL:
            return NOT_LEVELLED
        matrix = np.column_stack(
            [(differ(angles + step) - off) / STEP for step in STEP * np.eye(2)]
        )
        if abs(np.linalg.det(matrix)) < 1e-12:
            break
        angles = angles - np.linalg.solve(matrix, off)
        if np.abs(angles).max() > MAX_ANGLE:
            break
    if np.abs(angles).max() > MAX_ANGLE or np.abs(differ(angles)).max() > LEVEL:
        rear, middle, front = find_heights(np.zeros(2))
        raise RoverFileError(
            f"wheels at angle 0 are not level: rear {rear:.4g}, middle {middle:.4g}, front "
            f"{front:.4g} m; give the angles of joints on flat ground, or correct axes"
        )
    return Levelling(*angles.tolist())


def _read_arm(tree: JointTree, arm: ArmMap) -> dict[str, Any]:
    """Return the contents of `manipulator` of a rover file.

    Args:
        tree: The robot in the body frame, the arm stowed.
        arm: Its joints.

    Raises:
        RoverFileError: A joint or link is missing, or the arm is no column with two links that
            point forward at 0.
    """
    joints = [tree.joint(name) for name in arm.joints]
    if arm.tip not in tree.links_on(joints[2]):
        raise RoverFileError(f"arm.tip: link {arm.tip!r} does not hang on joint {arm.joints[2]}")
    points = np.array([*(tree.origin(joint) for joint in joints), tree.place(arm.tip)[:3, 3]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    masses = []
    groups = [tree.links_on(joint) for joint in joints]
    for group, inner in zip(groups, [*groups[1:], {arm.tip}], strict=True):
        masses.append(tree.lump(group - inner).mass)
    found: dict[str, Any] = {
        "base": points[0].tolist(),
        "joints": list(arm.joints),
        "link_lengths": lengths.tolist(),
        "link_masses": masses,
        "stowed": list(arm.stowed),
        "payload": tree.lump({arm.tip}).mass,
    }
    limits = [[joint.limit.lower, joint.limit.upper] for joint in joints]
    if np.isfinite(limits).all():
        found["joint_limits"] = limits
    model = Manipulator(
        tuple(points[0]), arm.joints, tuple(lengths), (0.0, 0.0, 0.0), arm.stowed
    )  # fmt: skip
    off = np.abs(link_points(model, np.array(arm.stowed)) - points).max()
    if off > ARM_TOLERANCE:
        raise RoverFileError(
            f"arm: its joints are {off:.3g} m off a column along z with two links that point "
            "along x at 0 and turn about y; leave arm out, so that the arm is part of the body"
        )
    return found


def _angle_to_y(axis: Floats) -> float:
    """Return the angle between an axis (3,) and y, in either direction [rad]."""
    return float(np.arctan2(np.hypot(axis[0], axis[2]), abs(axis[1])))


def _pose(rotation: Floats) -> Floats:
    """Return a rotation (3, 3) as a pose (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    return pose


def _bounds(box: Solid, place: Floats) -> tuple[list[float], list[float]]:
    """Return the lowest and highest corner of what encloses a box, along the body's axes [m]."""
    half = 0.5 * np.abs(place[:3, :3]) @ np.array(box.size)
    return (place[:3, 3] - half).tolist(), (place[:3, 3] + half).tolist()


def _rounded(value: Any) -> Any:
    """Return contents with numbers of DECIMALS decimals, at any depth."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return round(value, DECIMALS) + 0.0 if isinstance(value, float) else value


def _merge(found: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Return contents with keys of another one put over them, at any depth."""
    merged = dict(found)
    for key, value in given.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merge(merged[key], value) if both else value
    return merged
