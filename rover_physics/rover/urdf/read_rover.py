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
from rover_physics.rover.urdf.joint_map import UrdfJointMap, load_joint_map
from rover_physics.rover.urdf.robot import Joint, Posture, Robot, Solid, read_robot

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
ROUNDED_MASS = 1e-12
"""Mass up to which a part has none: what rounding leaves of a difference [kg]."""
LEVEL = 1e-6
"""Height difference of wheels that counts as none [m]."""
MAX_ANGLE = 0.1
"""Largest pitch or bogie angle that is made up for [rad]."""


@dataclass(frozen=True)
class Levelling:
    """Pitch of the axes and angle of the bogies of a URDF on level ground."""

    pitch: float = 0.0
    """Pitch of the axes of the URDF [rad], positive nose down; that of the body frame is 0."""
    bogie: float = 0.0
    """Angle of both bogies about y, beyond that of the map [rad]."""


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
        reading = _Reading(robot, joints)
        reading.check()
        levelling = level_wheels(reading)
        if levelling != Levelling():
            reading = reading.turn(levelling)
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

    def __init__(
        self,
        robot: Robot,
        joints: UrdfJointMap,
        angles: dict[str, float] | None = None,
        rotation: Floats | None = None,
    ):
        """Place the links at the angles of the map, or others, and turned by it, or otherwise."""
        arm = joints.arm
        stowed = dict(zip(arm.joints, arm.stowed, strict=True)) if arm is not None else {}
        self._robot, self._joints = robot, joints
        self._angles = joints.angles | stowed if angles is None else angles
        self._rotation = joints.axes.rotation() if rotation is None else rotation
        for name in self._angles:
            robot.joint(name)
        self._rockers = {side: robot.joint(joints.rocker[side]) for side in SIDES}
        self._bogies = {side: robot.joint(joints.bogie[side]) for side in SIDES}
        self._wheels = {wheel: robot.joint(joints.wheels[wheel]) for wheel in WHEELS}
        self._steering = {name: robot.joint(joint) for name, joint in joints.steering.items()}
        self._fixed = [robot.joint(joint) for joint in joints.fixed]
        self._on_rocker = {side: self._find_rocker(side) for side in SIDES}
        self._on_bogie = {side: robot.links_on(self._bogies[side]) for side in SIDES}
        self.asymmetry = 0.0
        """Largest distance found so far between both sides [m]."""
        self._posture = Posture(robot, self._angles, self._rotation)
        points = [self._point_of(side, self._rockers[side]) for side in SIDES]
        self._posture.move(-0.5 * (points[0] + points[1]))

    def turn(self, levelling: Levelling) -> "_Reading":
        """Return the reading with the body frame and the bogies turned."""
        angles = dict(self._angles)
        for joint in self._bogies.values():
            turn = levelling.bogie if self._posture.axis(joint)[1] > 0.0 else -levelling.bogie
            angles[joint.name] = angles.get(joint.name, 0.0) + turn
        pitched = Rotation.from_euler("y", levelling.pitch).as_matrix() @ self._rotation
        return _Reading(self._robot, self._joints, angles, pitched)

    def _find_rocker(self, side: str) -> set[str]:
        """Return the links that hang on a rocker, of which some parts may hang on the body."""
        rocker, found = self._rockers[side], self._robot.links_on(self._rockers[side])
        wheels = {self._wheels[f"{position}_{side}"].child for position in WHEEL_POSITIONS}
        for joint in self._fixed:
            links = self._robot.links_on(joint)
            if joint.parent == rocker.parent and links & wheels:
                found |= links
        return found

    def contents(self) -> dict[str, Any]:
        """Return the keys of a rover file that the URDF gives; the others are left out."""
        found: dict[str, Any] = {
            "name": self._robot.name,
            "wheel": self._wheel(),
            "suspension": self._suspension(),
            "masses": self._masses(),
            "belly": self._belly(),
            "steering": self._steered(),
            "manipulator": self._arm(),
        }
        return {key: value for key, value in found.items() if value}

    def wheel_heights(self) -> list[float]:
        """Return the heights of rear, middle and front wheels, means of both sides [m]."""
        return [
            0.5 * sum(float(self._wheel_centre(f"{position}_{side}")[2]) for side in SIDES)
            for position in WHEEL_POSITIONS
        ]

    def _point_of(self, side: str, joint: Joint) -> Floats:
        """Return the point (3,) of a joint's axis amid the wheels of a side [m].

        An origin may lie anywhere along its axis; the wheels turn about this point.
        """
        wheels = [self._wheels[f"{position}_{side}"] for position in WHEEL_POSITIONS]
        y = np.mean([self._posture.point(wheel.child)[1] for wheel in wheels])
        point, axis = self._posture.point(joint.child).copy(), self._posture.axis(joint)
        if abs(axis[1]) > 0.5 and joint.kind != "fixed":
            point += (y - point[1]) / axis[1] * axis
        point[1] = y
        return point

    def tilt(self) -> float:
        """Return the largest angle between the pivot of a rocker and y [rad]."""
        turning = [one for one in self._rockers.values() if one.kind != "fixed"]
        return max((self._angle_to_y(one) for one in turning), default=0.0)

    def _angle_to_y(self, joint: Joint) -> float:
        """Return the angle between the axis of a joint and y, in either direction [rad]."""
        axis = self._posture.axis(joint)
        return float(np.arctan2(np.hypot(axis[0], axis[2]), abs(axis[1])))

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
                if kind != "rocker" or joint.kind != "fixed":
                    self._check_turns(kind, part, joint)
        self._check_names()
        for side in SIDES:
            self._check_side(side)

    def _check_turns(self, kind: str, part: str, joint: Joint) -> None:
        """Check that a joint turns about y."""
        key, axis = f"{kind}.{part}", self._posture.axis(joint)
        if joint.kind not in ("revolute", "continuous"):
            raise RoverFileError(f"{key}: joint {joint.name} is {joint.kind}; it must turn")
        rolls = all(self._angle_to_y(wheel) <= MAX_TILT for wheel in self._wheels.values())
        if kind != "wheels" and abs(axis[0]) > np.cos(MAX_TILT) and rolls:
            raise RoverFileError(
                f"{key}: joint {joint.name} turns about x: a rover of three bogies has neither "
                "rockers nor a differential; only rocker-bogies are read"
            )
        rises = kind == "rocker" and abs(axis[0]) < np.sin(MAX_TILT)
        if self._angle_to_y(joint) > (MAX_ROCKER_TILT if rises else MAX_TILT):
            raise RoverFileError(
                f"{key}: joint {joint.name} turns about {np.round(axis, 3).tolist()}; it must "
                "turn about y of the body frame (axes and angles of the map)"
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

    def _check_side(self, side: str) -> None:
        """Check what the joints of a side hang on, and that nothing else moves in between."""
        rocker, bogie, on_rocker = self._rockers[side], self._bogies[side], self._on_rocker[side]
        _check_below(f"bogie.{side}", bogie, rocker, on_rocker)
        for position in WHEEL_POSITIONS:
            wheel, key = f"{position}_{side}", f"wheels.{position}_{side}"
            joint, steering = self._wheels[wheel], self._steering.get(wheel)
            _check_below(key, joint, rocker, on_rocker)
            if steering is not None:
                _check_below(key, joint, steering, self._robot.links_on(steering))
            known = (rocker, bogie, joint, steering, *self._fixed)
            for other in self._robot.joints_between(joint.child, rocker.parent):
                if other.kind != "fixed" and other not in known:
                    raise RoverFileError(
                        f"{key}: it hangs on joint {other.name}, which is {other.kind} and has no "
                        "part in the map: name it under steering, or under fixed if it does not "
                        "move"
                    )
        y = np.mean([self._wheel_centre(f"{one}_{side}")[1] for one in WHEEL_POSITIONS])
        if (y > 0.0) != (side == "left"):
            raise RoverFileError(
                f"rocker.{side}: y is {y:.4g} m in the body frame, on the other side; sides "
                "are exchanged, or axes.forward or axes.up is wrong"
            )

    def _pivots(self, key: str, joints: dict[str, Joint]) -> list[float]:
        """Return a pivot of the left side; where along its axis an origin lies means nothing."""
        points = {side: self._point_of(side, joints[side]) for side in SIDES}
        y = {side: self._posture.point(joint.child)[1] for side, joint in joints.items()}
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
        tyre = self._tyre(wheel)
        return self._posture.point(self._wheels[wheel].child) if tyre is None else tyre[1][:3, 3]

    def _tyre(self, wheel: str) -> tuple[Solid, Floats] | None:
        """Return the cylinder of a wheel with the largest radius; others are hubs or motors."""
        links = self._robot.links_on(self._wheels[wheel])
        cylinders = self._posture.solids(links, "cylinder")
        return max(cylinders, key=lambda one: one[0].size[0], default=None)

    def _wheel(self) -> dict[str, float]:
        """Return size, mass and drive of the wheels."""
        found = {"mass": self._wheel_mass()}
        tyres = [tyre for tyre in map(self._tyre, WHEELS) if tyre is not None]
        if len(tyres) == len(WHEELS):
            sizes = np.array([tyre[0].size for tyre in tyres])
            if np.ptp(sizes, axis=0).max() > 1e-3:
                raise RoverFileError("wheels have cylinders of several sizes; all must be alike")
            found["radius"], found["width"] = sizes.mean(axis=0).tolist()
        joints = self._wheels.values()
        return found | _finite(
            max_torque=min(joint.effort for joint in joints),
            max_speed=min(joint.velocity for joint in joints),
        )

    def _suspension(self) -> dict[str, Any]:
        """Return pivots, wheel centres and limits."""
        on_bogie = {
            position
            for position in WHEEL_POSITIONS
            for side in SIDES
            if self._wheels[f"{position}_{side}"].child in self._on_bogie[side]
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
            limits = np.array([self._limits(joint) for joint in joints.values()])
            found |= _finite(**{key: [float(limits[:, 0].max()), float(limits[:, 1].min())]})
        return found

    def _limits(self, joint: Joint) -> tuple[float, float]:
        """Return lowest and highest angle about body y, counted from flat ground [rad]."""
        flat = self._angles.get(joint.name, 0.0)
        low, high = joint.lower - flat, joint.upper - flat
        return (low, high) if self._posture.axis(joint)[1] > 0.0 else (-high, -low)

    def _steered(self) -> dict[str, Any]:
        """Return the steered axles, their limit and rate; nothing if no wheel steers."""
        axles = [
            position
            for position in WHEEL_POSITIONS
            if any(f"{position}_{side}" in self._steering for side in SIDES)
        ]
        for wheel in (f"{axle}_{side}" for axle in axles for side in SIDES):
            if wheel not in self._steering:
                raise RoverFileError(f"missing key steering.{wheel}; both wheels of an axle steer")
        if not axles:
            return {}
        joints = self._steering.values()
        limit = min(min(abs(joint.lower), abs(joint.upper)) for joint in joints)
        rate = min(joint.velocity for joint in joints)
        return {"wheels": axles, **_finite(limit=limit, rate=rate)}

    def _masses(self) -> dict[str, Any]:
        """Return body, rocker and bogie; what a wheel weighs beyond the lightest is its link's."""
        masses, wheel_mass = self._posture.masses, self._wheel_mass()
        body = masses(set(self._robot.links) - self._on_rocker["right"] - self._on_rocker["left"])
        if self._joints.arm is not None:
            body = body - masses({self._joints.arm.tip})
        parts: dict[str, dict[str, Floats]] = {"rocker": {}, "bogie": {}}
        for side in SIDES:
            on_bogie = self._on_bogie[side]
            parts["rocker"][side] = masses(self._on_rocker[side] - on_bogie)
            parts["bogie"][side] = masses(on_bogie)
            for position in WHEEL_POSITIONS:
                wheel = f"{position}_{side}"
                part = "bogie" if self._wheels[wheel].child in on_bogie else "rocker"
                parts[part][side] -= wheel_mass * np.append(1.0, self._wheel_centre(wheel))
        pivots = {"rocker": self._rockers, "bogie": self._bogies}
        found: dict[str, Any] = {
            "body": {"mass": float(body[0]), "com": _com(body, np.zeros(3)).tolist()}
        }
        for name, sides in parts.items():
            mass = 0.5 * float(sides["right"][0] + sides["left"][0])
            coms = {
                side: _com(sides[side], self._posture.point(pivots[name][side].child))
                for side in SIDES
            }
            found[name] = {
                "mass": mass if mass > ROUNDED_MASS else 0.0,
                "com": self._mean(("masses", name, "com"), coms),
            }
        return found

    def _wheel_mass(self) -> float:
        """Return the mass of the lightest wheel with what steers it [kg]."""
        joints = [self._steering.get(wheel, self._wheels[wheel]) for wheel in WHEELS]
        return min(self._mass_of(self._robot.links_on(joint)) for joint in joints)

    def _mass_of(self, links: set[str]) -> float:
        return float(self._posture.masses(links)[0])

    def _belly(self) -> dict[str, Any]:
        """Return the underside of the lowest box of the body; nothing if there is none."""
        links = self._robot.rigid_group(self._rockers["right"].parent)
        links -= self._on_rocker["right"] | self._on_rocker["left"]
        boxes = [_bounds(*box) for box in self._posture.solids(links, "box")]
        if not boxes:
            return {}
        low, high = min(boxes, key=lambda box: box[0][2])
        return {"z": low[2], "x": [low[0], high[0]], "y": [low[1], high[1]]}

    def _arm(self) -> dict[str, Any]:
        """Return the contents of `manipulator` of a rover file; nothing if the map has no arm.

        Raises:
            RoverFileError: A joint or link is missing, or the arm is no column with two links that
                point forward at 0.
        """
        arm = self._joints.arm
        if arm is None:
            return {}
        joints = [self._robot.joint(name) for name in arm.joints]
        groups = [self._robot.links_on(joint) for joint in joints]
        if arm.tip not in groups[2]:
            raise RoverFileError(
                f"arm.tip: link {arm.tip!r} does not hang on joint {arm.joints[2]}"
            )
        links = [*(joint.child for joint in joints), arm.tip]
        points = np.array([self._posture.point(link) for link in links])
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        model = Manipulator(
            tuple(points[0]), arm.joints, tuple(lengths), (0.0, 0.0, 0.0), arm.stowed
        )  # fmt: skip
        off = np.abs(link_points(model, np.array(arm.stowed)) - points).max()
        if off > ARM_TOLERANCE:
            raise RoverFileError(
                f"arm: its joints are {off:.3g} m off a column along z with two links that point "
                "along x at 0 and turn about y; leave arm out, so that the arm is part of the body"
            )
        return {
            "base": points[0].tolist(),
            "joints": list(arm.joints),
            "link_lengths": lengths.tolist(),
            "link_masses": [
                self._mass_of(group - further)
                for group, further in zip(groups, [*groups[1:], {arm.tip}], strict=True)
            ],
            "stowed": list(arm.stowed),
            "payload": self._mass_of({arm.tip}),
            **_finite(joint_limits=[[joint.lower, joint.upper] for joint in joints]),
        }


def level_wheels(reading: _Reading) -> Levelling:
    """Find the pitch and the bogie angle at which all wheels are level.

    Returns:
        No angles where the wheels are level as the URDF has them.

    Raises:
        RoverFileError: There are none within MAX_ANGLE.
    """

    def differ(angles: Floats) -> Floats:
        rear, middle, front = reading.turn(Levelling(*angles.tolist())).wheel_heights()
        return np.array([middle - rear, front - rear])

    if np.abs(differ(np.zeros(2))).max() <= LEVEL:
        return Levelling()
    from scipy import optimize  # imported here: few URDFs need it

    angles = optimize.root(differ, np.zeros(2), tol=1e-12).x
    if np.abs(angles).max() > MAX_ANGLE or np.abs(differ(angles)).max() > LEVEL:
        rear, middle, front = reading.wheel_heights()
        raise RoverFileError(
            f"wheels at angle 0 are not level: rear {rear:.4g}, middle {middle:.4g}, front "
            f"{front:.4g} m; give the angles of joints on flat ground, or correct axes"
        )
    return Levelling(*angles.tolist())


def _check_below(key: str, joint: Joint, above: Joint, links: set[str]) -> None:
    """Check that a joint hangs on another one, on which `links` do."""
    if joint.child == above.child or joint.child not in links:
        raise RoverFileError(
            f"{key}: its link {joint.child} does not hang on {above.child} in the URDF; where "
            "the parts of a rocker have joints of their own, name those under fixed"
        )


def _com(masses: Floats, missing: Floats) -> Floats:
    """Return the centre of mass (3,) [m] of `Posture.masses`; `missing` if there is no mass."""
    return masses[1:] / masses[0] if masses[0] > ROUNDED_MASS else missing


def _finite(**limits: Any) -> dict[str, Any]:
    """Return limits without those that are infinite, which the URDF does not set."""
    return {key: limit for key, limit in limits.items() if np.isfinite(limit).all()}


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
