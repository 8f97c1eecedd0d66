# SPDX-License-Identifier: Apache-2.0
"""Mounts of sensors on the robot, by the parameter sensor_mounts."""

import math
from collections.abc import Sequence

from rover_planner.errors import PlanningError
from rover_planner.parameters.traverse_server import NO_MOUNTS
from rover_planner.planning.navigation.transforms import Rigid

FORM = "frame:x:y:z:roll:pitch:yaw, such as front_camera:0.3:0.0:0.4:0.0:0.5:0.0"
"""Form of an entry, for error texts."""
MAX_ARM = 100.0
"""Largest distance of a sensor from the robot's frame along an axis [m]."""


def read_mounts(entries: Sequence[str]) -> dict[str, Rigid]:
    """Return the mounts of the parameter sensor_mounts by the names of their frames.

    Raises:
        PlanningError: An entry has another form, or a frame has two.
    """
    mounts: dict[str, Rigid] = {}
    for entry in () if entries == NO_MOUNTS else entries:
        name, *rest = (part.strip() for part in entry.split(":"))
        try:
            numbers = [float(text) for text in rest]
        except ValueError:
            numbers = []
        far = [n for n in numbers[:3] if not abs(n) <= MAX_ARM]
        turned = [n for n in numbers[3:] if not abs(n) <= 2.0 * math.pi]
        if len(numbers) != 6 or not name or far or turned:
            raise PlanningError(
                f"sensor_mounts has {entry!r}; it must be {FORM}, with lengths in m up to "
                f"{MAX_ARM:g} and angles in rad up to 2 pi"
            )
        if name in mounts:
            raise PlanningError(f"sensor_mounts has the frame {name!r} twice; it has one mount")
        x, y, z, roll, pitch, yaw = numbers
        mounts[name] = Rigid.from_rpy(x, y, z, roll, pitch, yaw)
    return mounts
