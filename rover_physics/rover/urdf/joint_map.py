# SPDX-License-Identifier: Apache-2.0
"""The joint map: which joints of a URDF are the rover's, and values that it does not give."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.files.rules import Keys, Radians, Rule, Text, choice
from rover_physics.files.validation import errors_of, read_as
from rover_physics.files.yaml_file import read_yaml
from rover_physics.names import SIDES, STEERING_JOINTS, WHEEL_JOINTS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_physics.rover.steering_joints import steered_wheels

DIRECTIONS = ("x", "-x", "y", "-y", "z", "-z")
Direction = Annotated[str, choice(*DIRECTIONS)]
ARM_TIP = "arm_tip"
"""Name of the link at the tip of a written rover's arm."""
OF_URDF = ("name", "suspension", "masses", "belly", "steering", "manipulator")
"""Keys of a rover file that a URDF gives; a written map has all others."""
WHEEL_OF_URDF = ("radius", "width", "mass", "max_torque", "max_speed")
"""Keys of a wheel that it gives."""


@dataclass(frozen=True)
class ArmMap:
    """The joints of a three-joint arm."""

    joints: Annotated[tuple[str, str, str], Rule("a list of 3 names of joints")]
    """Joints of base yaw, shoulder and elbow; at 0 the arm points forward."""
    tip: Text
    """Link at the tip; its mass is the payload."""
    stowed: Annotated[tuple[Radians, Radians, Radians], Rule("a list of 3 numbers in rad")]
    """Angles of the stowed pose [rad]."""


@dataclass(frozen=True)
class Axes:
    """Two axes of the URDF's root link."""

    forward: Direction = "x"
    """Axis that points to the rover's front."""
    up: Direction = "z"
    """Axis that points up."""

    def rotation(self) -> Floats:
        """Return (3, 3), which turns vectors of the root link into the body frame.

        Raises:
            RoverFileError: Both are the same axis.
        """
        forward, up = (_unit(name) for name in (self.forward, self.up))
        if forward @ up != 0.0:
            raise RoverFileError(f"axes.up is {self.up}; it must be across forward {self.forward}")
        return np.array([forward, np.cross(up, forward), up])


@dataclass(frozen=True)
class UrdfJointMap:
    """Names of a URDF's joints by their part in the rover."""

    rocker: Annotated[dict[str, Text], Keys(dict.fromkeys(SIDES, Text))]
    """Joints between body and rockers, keys ``"right"``, ``"left"``."""
    bogie: Annotated[dict[str, Text], Keys(dict.fromkeys(SIDES, Text))]
    """Joints between rockers and bogies."""
    wheels: Annotated[dict[str, Text], Keys(dict.fromkeys(WHEELS, Text))]
    """Joints that drive the wheels, keys as in WHEELS."""
    steering: Annotated[dict[str, Text], Keys({}, dict.fromkeys(WHEELS, Text))] = field(
        default_factory=dict
    )
    """Joints that steer, keys as in WHEELS; those of both sides."""
    fixed: tuple[Text, ...] = ()
    """Joints that turn in the URDF and do not on the rover, at their `angles`: those between the
    parts of a rocker, for example."""
    axes: Axes = field(default_factory=Axes)
    """Axes of the root link; REP-103's where the map has none."""
    angles: dict[str, Radians] = field(default_factory=dict)
    """Angles of joints on flat ground [rad]; 0 for all others."""
    arm: ArmMap | None = None
    """The arm; None: it is a part of the body, at `angles`."""
    rover: dict[str, Any] = field(default_factory=dict)
    """Keys of a rover file that the URDF does not give or gives wrongly."""


def load_joint_map(path: Path) -> UrdfJointMap:
    """Load a joint map from a YAML file.

    Raises:
        RoverFileError: Not a YAML file, or a key is missing, unknown or invalid.
    """
    with errors_of(path):
        joint_map: UrdfJointMap = read_as(UrdfJointMap, read_yaml(path), "a joint map")
    return joint_map


def map_of(rover: Rover) -> dict[str, Any]:
    """Return the contents of the map that reads a rover back from the URDF of `write_urdf`."""
    rest = {key: value for key, value in rover_to_dict(rover).items() if key not in OF_URDF}
    rest["wheel"] = {key: rest["wheel"][key] for key in rest["wheel"] if key not in WHEEL_OF_URDF}
    joints: dict[str, Any] = {
        "rocker": {side: f"rocker_{side}" for side in SIDES},
        "bogie": {side: f"bogie_{side}" for side in SIDES},
        "wheels": dict(zip(WHEELS, WHEEL_JOINTS, strict=True)),
    }
    if rover.steering is not None:
        steered = steered_wheels(rover).tolist()
        joints["steering"] = {WHEELS[wheel]: STEERING_JOINTS[wheel] for wheel in steered}
    if rover.manipulator is not None:
        arm = rover.manipulator
        joints["arm"] = {"joints": list(arm.joints), "tip": ARM_TIP, "stowed": list(arm.stowed)}
    return {**joints, "rover": rest}


def _unit(name: str) -> Floats:
    """Return the unit vector of a direction."""
    vector = np.zeros(3)
    vector["xyz".index(name[-1])] = -1.0 if name.startswith("-") else 1.0
    return vector
