# SPDX-License-Identifier: Apache-2.0
"""The map of the traction controller: clouds of the map's frame, or of one that /tf connects."""

import time
from collections.abc import Callable

from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_from_point_cloud
from rover_physics.rover.model import Rover
from rover_physics.traction.map_contacts import MapContactFinder
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.frames import NodeFrames
from rover_planner.ros.logs import RepeatLog
from rover_planner.ros.map_intake import CLOUD, MapIntake
from rover_planner.ros.node import RoverNode


class TractionMaps(MapIntake[MapContactFinder]):
    """Prepares clouds for the controller in a thread of their own."""

    def __init__(
        self,
        node: RoverNode[TractionControllerParameters],
        rover: Callable[[], Rover],
        frames: NodeFrames,
    ):
        """Start the thread.

        Args:
            node: The node.
            rover: Returns the rover for which maps are prepared.
            frames: Knows where the frames of clouds are on the map.
        """
        self._node, self._rover, self._listen = node, rover, frames.listen
        self._values = node.values
        self._refusals = RepeatLog()
        super().__init__(self._make, self._log_refusal, frames)

    def apply(self) -> None:
        """Prepare the last map again if a parameter of it has changed."""
        before, self._values = self._values, self._node.values
        names = ("map_resolution", "cell_height")
        if any(getattr(before, name) != getattr(self._values, name) for name in names):
            self.repeat()

    def look_for_frame(self) -> None:
        """Listen to /tf if a map needs it, and take it when its frame is known; call it often."""
        if self.waits_for_frame:
            self._listen()  # only then: /tf of a whole robot costs the loop time
            self.retry()

    def _make(self, cloud: PointCloud2, source: Rigid | None) -> MapContactFinder:
        """Prepare a map from a cloud; called in the thread."""
        values, move = self._values, None if source is None else source.matrix
        terrain = terrain_from_point_cloud(cloud, values.map_resolution, values.cell_height, move)
        return MapContactFinder(self._rover(), terrain)

    def _log_refusal(self, error: str) -> None:
        line = f"{CLOUD} refused, the last map stays: {error}"
        line = self._refusals.line(line, time.monotonic())
        if line:
            self._node.get_logger().error(line)
