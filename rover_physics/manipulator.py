"""The paper's three-joint arm: its kinematics, and what it and its tool do to the body."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import ModelError
from rover_physics.rover import Manipulator, Rover


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


def body_mass_and_com(
    rover: Rover, joint_angles: Mapping[str, float] | None = None, payload: float | None = None
) -> tuple[float, np.ndarray]:
    """Return mass [kg] and centre of mass (3,) [m], body frame, of the body with arm and payload.

    The body of the rover file holds the stowed arm, so the arm moves the centre of mass by the
    difference to its stowed pose; the payload hangs at the tip.

    Args:
        rover: The rover.
        joint_angles: Arm angles [rad] by joint name; joints left out stay stowed, other names
            are passed over.
        payload: Mass at the tip [kg]; the rover file's by default.

    Raises:
        ModelError: An angle that is not finite, a payload that is negative or without an arm.
    """
    body = rover.masses.body
    mass, moment = body.mass, body.mass * np.asarray(body.com, dtype=float)
    arm = rover.manipulator
    if arm is None:
        if payload:
            raise ModelError(f"payload {payload} kg, but rover {rover.name!r} has no manipulator")
        return mass, moment / mass
    load = arm.payload if payload is None else payload
    if not (np.isfinite(load) and load >= 0.0):
        raise ModelError(f"payload is {load}; it must be a mass of 0 kg or more")
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
    """Return where the arm's tip is and what acts on it: (3, 3), rows tip, force and moment.

    Args:
        rover: The rover.
        joint_angles: Arm angles [rad] by joint name, as in `body_mass_and_com`.
        force: (3,) force [N] that the surroundings exert on the tool, body frame.
        moment: (3,) moment [N m] that they exert on it about the tip, body frame.

    Raises:
        ModelError: Force or moment of wrong shape, not finite, or without an arm.
    """
    tool = np.zeros((3, 3))
    for row, (name, given) in enumerate((("tool_force", force), ("tool_moment", moment)), start=1):
        if given is not None:
            tool[row] = _as_vector(name, given)
            if rover.manipulator is None:
                raise ModelError(
                    f"{name} {tool[row].tolist()}, but rover {rover.name!r} has no manipulator"
                )
    if rover.manipulator is not None:
        angles = arm_angles(rover.manipulator, joint_angles)
        tool[0] = link_points(rover.manipulator, angles)[3]
    return tool


def _as_vector(name: str, given: ArrayLike) -> np.ndarray:
    try:
        vector = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name} is {given!r}; it must be three numbers x, y, z") from error
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ModelError(f"{name} is {given!r}; it must be three finite numbers x, y, z")
    return vector


def arm_angles(arm: Manipulator, joint_angles: Mapping[str, float] | None) -> np.ndarray:
    """Return the angles (3,) [rad] of the arm's joints, stowed where `joint_angles` has none.

    Raises:
        ModelError: An angle that is not finite.
    """
    given = joint_angles or {}
    angles = [
        given.get(name, at_rest) for name, at_rest in zip(arm.joints, arm.stowed, strict=True)
    ]
    for name, angle in zip(arm.joints, angles, strict=True):
        if not np.isfinite(angle):
            raise ModelError(f"angle of joint {name!r} is {angle}; it must be finite, in rad")
    return np.asarray(angles, dtype=float)
