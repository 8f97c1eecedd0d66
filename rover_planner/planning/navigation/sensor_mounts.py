# SPDX-License-Identifier: Apache-2.0
"""Poses of sensors: their mounts on the robot, and the robot at the time of a measurement."""

import math
from collections.abc import Mapping, Sequence

from rover_planner.errors import PlanningError
from rover_planner.parameters.traverse_server import NO_MOUNTS, TraverseServerParameters
from rover_planner.planning.navigation.transforms import Rigid, TransformError, TransformTree

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
    for entry in entries:
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


class SensorPoses:
    """Finds where a sensor was in the map frame; may be used by several threads."""

    def __init__(
        self, mounts: Mapping[str, Rigid], map_frame: str, base_frame: str, timeout: float
    ):
        """Take the mounts on the robot.

        Args:
            mounts: Poses of sensor frames in the robot's frame, by name.
            map_frame: Frame of the map.
            base_frame: Frame of the robot.
            timeout: Age from which odometry is stale [s].
        """
        self._mounts = {base_frame: Rigid.none(), **mounts}
        self._map, self._base = map_frame, base_frame
        self.driven = TransformTree(timeout)
        """Where odometry says that the robot's frame is in the map frame."""

    def take(self, robot: Rigid, stamp: int) -> None:
        """Keep where odometry says that the robot's frame is in the map frame at a time [ns]."""
        self.driven.take(self._map, self._base, stamp, robot)

    def find(self, frame: str, stamp: int | None, now: int, tree: TransformTree) -> Rigid:
        """Return where a sensor's frame is in the map frame.

        The mount on the robot is that of the parameter, else that of /tf. The robot is where /tf
        says; if /tf does not connect it with the map, where odometry does.

        Args:
            frame: Name of the sensor's frame.
            stamp: Time of the measurement [ns]; None is the newest.
            now: Present time [ns].
            tree: The transforms of /tf.

        Raises:
            TransformError: The mount is not known, or the robot's pose is not known then, or
                stale.
        """
        mount = self._mounts.get(frame)
        if mount is None:
            if tree.connects(self._map, frame):
                return tree.find(self._map, frame, stamp, now)
            if not tree.connects(self._base, frame):
                raise TransformError(
                    f"the message is in frame {frame!r}; it must be in {self._map!r}, or in a "
                    "frame of /tf or sensor_mounts; known are "
                    + ", ".join(sorted({*self._mounts, *tree.frames()}))
                )
            mount = tree.find(self._base, frame, stamp, now)
        return self._find_robot(stamp, now, tree).then(mount)

    def _find_robot(self, stamp: int | None, now: int, tree: TransformTree) -> Rigid:
        if tree.connects(self._map, self._base):
            return tree.find(self._map, self._base, stamp, now)
        if not self.driven.has_parent(self._base):
            raise TransformError(
                f"neither /tf nor odometry says where {self._base!r} is in {self._map!r}"
            )
        try:
            return self.driven.find(self._map, self._base, stamp, now)
        except TransformError as error:
            raise TransformError(f"by odometry: {error}") from None


def sensor_poses(parameters: TraverseServerParameters) -> SensorPoses:
    """Return what finds sensors with the mounts of the parameters.

    Raises:
        PlanningError: The parameter sensor_mounts is wrong.
    """
    entries = parameters.sensor_mounts
    return SensorPoses(
        {} if entries == NO_MOUNTS else read_mounts(entries),
        parameters.map_frame,
        parameters.base_frame,
        parameters.transform_timeout,
    )
