# SPDX-License-Identifier: Apache-2.0
"""Reads a three-joint arm from the links and joints of a URDF."""

from typing import Any

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator
from rover_physics.rover.urdf.joint_map import ArmMap
from rover_physics.rover.urdf.tree import Tree

TOLERANCE = 1e-3
"""Largest distance of a joint from where the arm's model has it [m]."""


def read_arm(tree: Tree, arm: ArmMap) -> dict[str, Any]:
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
    if off > TOLERANCE:
        raise RoverFileError(
            f"arm: its joints are {off:.3g} m off a column along z with two links that point "
            "along x at 0 and turn about y; leave arm out, so that the arm is part of the body"
        )
    return found
