# SPDX-License-Identifier: Apache-2.0
"""The paper's three-joint arm: kinematics, mass and load on the body."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import ModelError
from rover_physics.numerics.plausible import MAX_FORCE, MAX_MASS
from rover_physics.rover.model import Manipulator, Rover

ROUNDING = 1e-6
"""Excess of an angle over a joint's limit [rad], and of a distance over the arm's reach [m], that
counts as rounding."""


def link_points(arm: Manipulator, angles: np.ndarray) -> np.ndarray:
    """Return the ends of the links, from the base to the tip: (4, 3) [m], body frame.

    Args:
        arm: The manipulator.
        angles: (3,) base yaw about z, shoulder and elbow pitch about y, positive downwards [rad].
    """
    yaw, shoulder, elbow = angles
    column, upper, fore = arm.link_lengths
    base = np.asarray(arm.base, dtype=float)
    pitch = np.array([shoulder, shoulder + elbow])
    reach, height = np.cos(pitch), -np.sin(pitch)
    away = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    top = base + column * up
    wrist = top + upper * (reach[0] * away + height[0] * up)
    tip = wrist + fore * (reach[1] * away + height[1] * up)
    return np.array([base, top, wrist, tip])


def distance_to_reach(arm: Manipulator, point: ArrayLike) -> float:
    """Return the distance [m] of a point (3,) [m], body frame, from the reach of the tip.

    It is above 0 if the point is too far from the shoulder, below 0 if it is too near, and 0 if
    the tip can reach it. Joint limits are not checked.
    """
    _, upper, fore = arm.link_lengths
    with np.errstate(over="ignore"):  # a point so far away is infinitely far
        distance = float(np.linalg.norm(_from_shoulder(arm, point)))
    gap = max(distance - (upper + fore), 0.0) + min(distance - abs(upper - fore), 0.0)
    return gap if abs(gap) > ROUNDING else 0.0


def inverse_kinematics(arm: Manipulator, point: ArrayLike) -> list[np.ndarray]:
    """Return the joint angles (3,) [rad] that bring the tip to a point (3,) [m], body frame.

    Elbow up comes first, then elbow down. The arm faces the point; if that is beyond the joint
    limits it turns away and reaches over its back, with its links in the same places. Angles are
    from -pi to pi, or shifted by a full turn if this brings them within the joint's limits.
    Solutions beyond the joint limits are left out; the list is empty if the point is out of reach.
    """
    if distance_to_reach(arm, point) != 0.0:
        return []
    _, upper, fore = arm.link_lengths
    x, y, z = _from_shoulder(arm, point)
    away = np.hypot(x, y)
    yaw = np.arctan2(y, x) if away > 0.0 else arm.stowed[0]
    bend = 0.0
    if upper > 0.0 and fore > 0.0:
        cosine = (away**2 + z**2 - upper**2 - fore**2) / (2.0 * upper * fore)
        bend = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    solutions = []
    for elbow in (bend, -bend):
        inner = np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
        shoulder = np.arctan2(-z, away) - inner
        facing, over_back = (yaw, shoulder, elbow), (yaw + np.pi, np.pi - shoulder, -elbow)
        fitting = [_within_limits(arm, np.array(angles)) for angles in (facing, over_back)]
        solutions += [angles for angles in fitting if angles is not None][:1]
    return solutions


def _from_shoulder(arm: Manipulator, point: ArrayLike) -> np.ndarray:
    shoulder = np.add(arm.base, [0.0, 0.0, arm.link_lengths[0]])
    return np.asarray(point, dtype=np.float64) - shoulder


def _within_limits(arm: Manipulator, angles: np.ndarray) -> np.ndarray | None:
    angles = (angles + np.pi) % (2.0 * np.pi) - np.pi
    for k, (low, high) in enumerate(arm.joint_limits or ()):
        turns = angles[k] + 2.0 * np.pi * np.array([0.0, -1.0, 1.0])
        fits = turns[(turns >= low - ROUNDING) & (turns <= high + ROUNDING)]
        if not fits.size:
            return None
        angles[k] = fits[0]
    return angles


def body_mass_and_com(
    rover: Rover, joint_angles: Mapping[str, float] | None = None, payload: float | None = None
) -> tuple[float, np.ndarray]:
    """Return mass [kg] and centre of mass (3,) [m], body frame, of the body with arm and payload.

    The body of the rover file includes the stowed arm, so only the difference to the stowed pose
    moves the centre of mass. The payload is at the tip.

    Args:
        rover: The rover.
        joint_angles: Arm angles [rad] by joint name; joints left out stay stowed, other names
            are ignored.
        payload: Mass at the tip [kg] (default: that of the rover file).

    Raises:
        ModelError: An angle that is not finite or beyond its limits, a payload that is negative
            or without an arm.
    """
    body = rover.masses.body
    mass, moment = body.mass, body.mass * np.asarray(body.com, dtype=float)
    arm = rover.manipulator
    if arm is None:
        if payload:
            raise ModelError(f"payload {payload} kg, but rover {rover.name!r} has no manipulator")
        return mass, moment / mass
    load = arm.payload if payload is None else payload
    if not 0.0 <= load <= MAX_MASS:
        raise ModelError(f"payload is {load}; it must be a mass of 0 kg or more, to {MAX_MASS:g}")
    now = link_points(arm, arm_angles(arm, joint_angles))
    stowed = link_points(arm, np.asarray(arm.stowed, dtype=float))
    for k, link_mass in enumerate(arm.link_masses):
        moment = moment + link_mass * (now[k] + now[k + 1] - stowed[k] - stowed[k + 1]) / 2.0
    return mass + load, (moment + load * now[3]) / (mass + load)


def pack_tool(
    rover: Rover,
    joint_angles: Mapping[str, float] | None = None,
    force: ArrayLike | None = None,
    moment: ArrayLike | None = None,
) -> np.ndarray:
    """Return (3, 3): tip of the arm [m], force [N] and moment [N m] on the tool, body frame.

    Args:
        rover: The rover.
        joint_angles: Arm angles [rad] by joint name, as in `body_mass_and_com`.
        force: (3,) force of the surroundings on the tool [N], body frame (default: none).
        moment: (3,) moment of the surroundings on the tool about its tip [N m], body frame
            (default: none).

    Raises:
        ModelError: Force or moment of wrong shape, not finite, or without an arm.
    """
    tool = np.zeros((3, 3))
    for row, (name, given) in enumerate((("tool_force", force), ("tool_moment", moment)), start=1):
        if given is not None:
            tool[row] = as_vector(name, given)
            if rover.manipulator is None:
                raise ModelError(
                    f"{name} {tool[row].tolist()}, but rover {rover.name!r} has no manipulator"
                )
    if rover.manipulator is not None:
        angles = arm_angles(rover.manipulator, joint_angles)
        tool[0] = link_points(rover.manipulator, angles)[3]
    return tool


def as_vector(name: str, given: ArrayLike) -> np.ndarray:
    """Return a vector (3,) of finite numbers, each of at most MAX_FORCE.

    Raises:
        ModelError: Anything else; the text says `name`.
    """
    try:
        vector = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name} is {given!r}; it must be three numbers x, y, z") from error
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ModelError(f"{name} is {given!r}; it must be three finite numbers x, y, z")
    if np.abs(vector).max() > MAX_FORCE:
        raise ModelError(
            f"{name} is {vector.tolist()}; each must be within {-MAX_FORCE:g} to {MAX_FORCE:g}"
        )
    return vector


def arm_angles(arm: Manipulator, joint_angles: Mapping[str, float] | None) -> np.ndarray:
    """Return the joint angles (3,) [rad] of the arm; joints not in `joint_angles` are stowed.

    Raises:
        ModelError: An angle that is not finite or beyond the limits of its joint.
    """
    given = joint_angles or {}
    angles = [
        given.get(name, at_rest) for name, at_rest in zip(arm.joints, arm.stowed, strict=True)
    ]
    for name, angle in zip(arm.joints, angles, strict=True):
        if not np.isfinite(angle):
            raise ModelError(f"angle of joint {name!r} is {angle}; it must be finite, in rad")
    for k, (low, high) in enumerate(arm.joint_limits or ()):
        if not low - ROUNDING <= angles[k] <= high + ROUNDING:
            raise ModelError(
                f"angle of joint {arm.joints[k]!r} is {angles[k]:.6g}; it must be within "
                f"{low:g} to {high:g} rad"
            )
    return np.asarray(angles, dtype=float)
