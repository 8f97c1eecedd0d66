# SPDX-License-Identifier: Apache-2.0
"""Takes the messages of a traverse server, live or recorded, into its service and its map."""

import time
from collections.abc import Callable
from typing import Any

from nav_msgs.msg import Path
from sensor_msgs.msg import JointState

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.grid_map import GridMapLayers, terrain_from_grid_map
from msg_adapters.identity import path_hash
from msg_adapters.joints import read_joint_map
from msg_adapters.sensors import BASE_FRAME, ImuMounting, imu_to_attitude
from msg_adapters.stamps import NANOSECONDS, stamp_to_ns
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.maps.ground_beneath import Standing
from rover_planner.maps.known_map import stamp_text
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.living_map import MapSnapshot
from rover_planner.planning.answering.map_keeper import MapKeeper
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.planning.answering.traverse_service import MAX_AGE, TraverseService
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.frames import Frames

LOOK_PERIOD = 0.5
"""Shortest time between two looks for unknown ground under the rover [s]."""


class ServerInputs:
    """Reads messages for a `TraverseService`; those of maps may come in another thread."""

    def __init__(
        self,
        parameters: TraverseServerParameters,
        frames: Frames,
        clock: Callable[[], float] = time.monotonic,
    ):
        """Begin with the map of the parameter terrain_file, if there is one.

        Args:
            parameters: Those of the server.
            frames: Knows where frames and sensors are on the map.
            clock: Returns the time [s] that measurements and maps age by.

        Raises:
            RoverError: Rover or map cannot be loaded, or the parameters do not agree with them.
        """
        self.frames = frames
        """Places of frames and sensors on the map."""
        self.service = TraverseService(load_service_settings(parameters), clock)
        """Knows map, path and measurements."""
        self.keeper = MapKeeper(self.service.settings.rover, parameters)
        """Makes one map of those that come."""
        arm = self.service.settings.manipulator_joints
        joints = SUSPENSION_JOINTS + WHEEL_JOINTS + STEERING_JOINTS + arm
        self.joint_names = read_joint_map(parameters.joint_map, joints, parameters.steering_sign)
        """Names of the joints in messages."""
        self._mounting = ImuMounting(parameters.imu_frame or BASE_FRAME, parameters.imu_mounting)
        self._clock, self._looked = clock, -float("inf")
        self._filled: tuple[Standing, Terrain | None] | None = None
        self._odometry_stamp: int | None = None
        if parameters.terrain_file:
            terrain = load_terrain(parameters.terrain_file, parameters.max_map_cells)
            self.keep(self.keeper.load(terrain, self.seconds, None), parameters.terrain_file)
            self.service.prepare()

    @property
    def seconds(self) -> float:
        """The present ROS time [s]."""
        return self.frames.now() / NANOSECONDS

    def take_joints(self, state: JointState) -> None:
        """Take joint angles.

        Raises:
            MessageError: A value is wrong.
        """
        heard = SUSPENSION_JOINTS + self.service.settings.manipulator_joints
        self.service.take_joints(self.joint_names.positions(state, heard))

    def take_odometry(self, odometry: Any) -> None:
        """Take the pose of the robot, as `read_raw` reads it, if it was measured anew.

        Raises:
            RoverError: A value is wrong, or the frame is not known.
        """
        last, self._odometry_stamp = self._odometry_stamp, stamp_to_ns(odometry.header.stamp)
        if last is None or last != self._odometry_stamp:
            pose, _ = self.frames.take_odometry(odometry)
            self.service.take_pose(pose)

    def find_here(self, max_age: float = MAX_AGE) -> Floats | None:
        """Return the pose (3,) of the body by /tf, else by odometry that is not older [s].

        Raises:
            TransformError: The transform of /tf is stale.
        """
        here = self.frames.find_here()
        return self.service.fresh_pose(max_age) if here is None else here

    def take_imu(self, imu: Any) -> None:
        """Take roll and pitch, if the parameter imu_attitude is set; see `take_odometry`.

        Raises:
            MessageError: A value is wrong.
        """
        if self.service.settings.parameters.imu_attitude:
            attitude = imu_to_attitude(imu, self._mounting)
            self.service.take_tilt(attitude.roll, attitude.pitch)

    def read_path(self, path: Path) -> GivenPath:
        """Return a path of the robot as one of the body in the map frame.

        Raises:
            RoverError: A value is wrong, or a frame is not known.
        """
        return GivenPath(self.frames.read_path(path), "", *describe_path(path))

    def take_map(self, message: Any, source: Rigid | None, topic: str) -> bool:
        """Take a PointCloud2 or GridMap; return whether its content is new.

        Args:
            message: The message.
            source: Where the frame of the message is in that of the map; None if it is that.
            topic: Its topic.

        Raises:
            MessageError: The message is no map.
            TerrainError: Its cells form no valid terrain.
            PlanningError: A GridMap leans, or the map would be too large.
        """
        stamp = stamp_to_ns(message.header.stamp)
        since = self.seconds if stamp is None else stamp / NANOSECONDS
        terrain = self._read_map(message, source)
        kept = self.keeper.take(terrain, topic, since, self.service.standing())
        return self.keep(kept, topic, stamp)

    def _read_map(self, message: Any, source: Rigid | None) -> Terrain:
        values = self.service.settings.parameters
        move = None if source is None else source.matrix
        if not hasattr(message, "layers"):  # it is a cloud
            resolution, height = values.map_resolution, values.cell_height
            return terrain_from_point_cloud(message, resolution, height, move)
        layers = GridMapLayers(
            values.elevation_layer, values.variance_layer, values.friction_layer
        )
        terrain = terrain_from_grid_map(message, layers)
        return terrain if move is None else self.keeper.place(terrain, move)

    def keep(self, snapshot: MapSnapshot, source: str, stamp: int | None = None) -> bool:
        """Keep a map in the service; return whether its content is new."""
        return self.service.take_terrain(snapshot.terrain, source, stamp, snapshot.sources)

    def may_fill_under_rover(self) -> bool:
        """Return whether unknown ground under the rover is to be filled.

        It is once each LOOK_PERIOD, if the rover has moved since or has another map.
        """
        now, values = self._clock(), self.service.settings.parameters
        if not values.fill_under_rover or now - self._looked < LOOK_PERIOD:
            return False
        standing, terrain = self.service.standing(), self.service.terrain
        if standing is None:
            return False
        self._looked, last = now, self._filled
        if last is not None and terrain is last[1] and standing.is_like(last[0]):
            return False
        self._filled = standing, terrain
        return True

    def fill_under_rover(self) -> MapSnapshot | None:
        """Fill unknown ground under the rover; return the map if that has changed it."""
        standing = self.service.standing()
        if standing is None or self.service.known_map is None:
            return None
        filled = self.keeper.fill(standing, self.seconds)
        if filled is not None:
            self.service.amend_map(filled.terrain, filled.sources)
        return filled


def describe_path(path: Path) -> tuple[str, str]:
    """Return the hash of a path and its stamp as text."""
    return path_hash(path), stamp_text(stamp_to_ns(path.header.stamp))
