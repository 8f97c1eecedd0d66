"""The node /traverse_server: answers over ROS 2 whether the rover can traverse a path."""

import gc
import sys
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Any
from urllib.parse import unquote, urlparse

import rclpy
import rclpy.logging
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan, LoadMap
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2
from std_srvs.srv import Trigger

from msg_adapters.elevation import terrain_from_point_cloud, terrain_to_occupancy_grid
from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from msg_adapters.joints import joint_positions
from msg_adapters.paths import (
    path_to_poses,
    stamped_pose_to_array,
)
from msg_adapters.verdicts import report_to_json
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.warm_up import warm_up
from rover_planner.nodes.programs import read_words
from rover_planner.nodes.reach_topics import ReachTopics
from rover_planner.nodes.result_topics import ResultTopics
from rover_planner.parameters.declare import declare_parameters, follow_changes
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.parameters.unknown import warn_of_unknown_parameters
from rover_planner.planning.judgement import Judgement, refusal
from rover_planner.planning.service_settings import load_service_settings
from rover_planner.planning.traverse_service import TraverseService
from rover_planner.ros.deferred_work import DeferredWork
from rover_planner.ros.qos import map_subscriptions_qos, sensor_qos, topic_qos
from rover_planner.ros.refusals import INPUT_ERRORS, answer_or_refuse
from rover_planner.shell.exit_codes import EXIT_BAD_INPUT, EXIT_OK
from rover_planner.worlds.summary import describe_terrain

NODE_NAME = "traverse_server"


class TraverseServer(Node):
    """Connects a TraverseService to ROS; invalid messages are refused and never end the node."""

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, **node_arguments)
        self._values = declare_parameters(self, TraverseServerParameters)
        self._service = TraverseService(load_service_settings(self._values))
        self._map_frame = self._values.map_frame
        self._seen_maps: deque[int] = deque(maxlen=8)
        self._deferred_work = DeferredWork(self)
        self._results = ResultTopics(self, self._deferred_work, self._map_frame)
        file = self._load_first_map()
        self._create_subscriptions()
        self.create_service(GetPlan, "~/can_traverse", self._can_traverse)
        self.create_service(Trigger, "~/check_path", self._check_path)
        self.create_service(LoadMap, "~/load_map", self._load_map)
        self._reach = ReachTopics(self, self._service, self._map_frame)
        follow_changes(self, lambda: self._values, load_service_settings, self._apply_parameters)
        warn_of_unknown_parameters(self, TraverseServerParameters)
        name, ground = self._service.settings.rover.name, self._service.terrain
        there = f"map {file}: {describe_terrain(ground)}" if ground else "no map yet"
        self.get_logger().info(f"ready for rover {name}, {there}")

    @property
    def service(self) -> TraverseService:
        """The service with the last map, path and joint angles."""
        return self._service

    @property
    def reach(self) -> ReachTopics:
        """The topics and the service of the arm."""
        return self._reach

    def _create_subscriptions(self) -> None:
        profiles = map_subscriptions_qos(self._values.map_durability)
        for qos in profiles:
            # With several profiles a mismatch of one of them is expected.
            events = SubscriptionEventCallbacks(use_default_callbacks=len(profiles) == 1)
            self.create_subscription(
                PointCloud2, "elevation_cloud", self._take_cloud, qos, event_callbacks=events
            )
        self.create_subscription(JointState, "joint_states", self._take_joints, sensor_qos())
        self.create_subscription(Path, "~/path", self._take_path, topic_qos())

    def _load_first_map(self) -> str:
        """Load the map of the parameter terrain_file, if it is set; return the file name."""
        file = self._values.terrain_file
        if file:
            try:
                self._service.take_terrain(load_terrain(file))
            except INPUT_ERRORS as error:
                self.get_logger().error(f"terrain_file not loaded: {error}")
        return file

    def _apply_parameters(self, parameters: TraverseServerParameters) -> None:
        self._values = parameters
        self._service.settings = load_service_settings(parameters)

    def _take_cloud(self, cloud: PointCloud2, info) -> None:
        if self._is_second_copy(info):
            return
        try:
            check_frame(cloud.header.frame_id, self._map_frame, "elevation_cloud")
            terrain = terrain_from_point_cloud(
                cloud, self._values.map_resolution, self._values.cell_height
            )
            self._take_terrain(terrain, "elevation_cloud")
        except INPUT_ERRORS as error:
            there = self._service.terrain is not None
            kept = "the last good map stays" if there else "there is no map yet"
            self.get_logger().error(f"elevation_cloud refused, {kept}: {error}")

    def _is_second_copy(self, info) -> bool:
        """Return whether the same map has already arrived through the other subscription."""
        stamp = info["source_timestamp"]
        if not stamp:
            return False
        if stamp in self._seen_maps:
            return True
        self._seen_maps.append(stamp)
        return False

    def _take_terrain(self, terrain: Terrain, source: str) -> None:
        self._service.take_terrain(terrain)
        taken = self._service.terrain
        assert taken is not None
        self.get_logger().info(f"map from {source}: {describe_terrain(taken)}")

    def _take_joints(self, state: JointState) -> None:
        try:
            self._service.take_joints(joint_positions(state, self._service.joint_names))
        except MessageError as error:
            self.get_logger().warning(
                f"{error}; the angles known before stay", throttle_duration_sec=5.0
            )

    def _take_path(self, path: Path) -> None:
        try:
            self._service.take_path(path_to_poses(path, self._map_frame))
        except MessageError as error:
            self._service.refuse_path(str(error))
            self.get_logger().error(f"~/path refused: {error}")

    def _can_traverse(
        self,
        request: GetPlan.Request,
        response: GetPlan.Response,
    ) -> GetPlan.Response:
        def answer() -> Judgement:
            start = stamped_pose_to_array(request.start, self._map_frame, "start")
            goal = stamped_pose_to_array(request.goal, self._map_frame, "goal")
            judgement = self._service.answer(start, goal, request.tolerance)
            if judgement.traversable:
                judgement.changes()  # computed here, so that an error becomes a refusal
            return judgement

        _, response.plan = self._judge("can_traverse", answer)
        return response

    def _check_path(
        self,
        _request: Trigger.Request,
        response: Trigger.Response,
    ) -> Trigger.Response:
        def answer() -> Judgement:
            judgement = self._service.check_last_path()
            _ = judgement.report  # computed here, so that an error becomes a refusal
            return judgement

        judgement, _ = self._judge("check_path", answer)
        response.success = judgement.traversable
        response.message = report_to_json(judgement.report)
        return response

    def _load_map(self, request: LoadMap.Request, response: LoadMap.Response) -> LoadMap.Response:
        file = _file_of_url(request.map_url)
        if file is None or not file.is_file():
            self.get_logger().error(
                f"load_map: no file {request.map_url!r}; it must be the path or file:// URL of a "
                "terrain file on this machine"
            )
            response.result = LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
            return response
        try:
            terrain = load_terrain(file)
            self._take_terrain(terrain, str(file))
        except INPUT_ERRORS as error:
            self.get_logger().error(f"load_map: {error}")
            response.result = LoadMap.Response.RESULT_INVALID_MAP_DATA
            return response
        response.map = terrain_to_occupancy_grid(
            terrain, self._map_frame, self.get_clock().now().to_msg()
        )
        response.result = LoadMap.Response.RESULT_SUCCESS
        return response

    def _judge(self, request: str, judge: Callable[[], Judgement]) -> tuple[Judgement, Path]:
        """Return the judgement of a request and its plan; any error becomes a refusal.

        Results are published and logged after the answer has been sent.
        """
        judgement = answer_or_refuse(self.get_logger(), request, judge, refusal)
        rover, spacing = self._service.settings.rover, self._values.plan_spacing
        log = partial(self._log, request, judgement)
        return judgement, self._results.take(judgement, rover, spacing, log)

    def _log(self, request: str, judgement: Judgement) -> None:
        text = f"{request}: {judgement.summary()}"
        if judgement.traversable:
            self.get_logger().info(text)
        else:
            self.get_logger().warning(text)


def _file_of_url(url: str) -> FilePath | None:
    """Return the file of a path or a file:// URL, None for other URLs."""
    parts = urlparse(url)
    if parts.scheme == "file":
        return FilePath(unquote(parts.path)) if parts.netloc in ("", "localhost") else None
    return FilePath(url) if "://" not in url else None


def main(words: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped; return 2 for a wrong argument or parameter, else 0."""
    logger = rclpy.logging.get_logger(NODE_NAME)
    try:
        if read_words(NODE_NAME, words) == EXIT_OK:  # help was printed
            return EXIT_OK
        logger.info("compiling kernels; the first start takes longest")
        warm_up()
        rclpy.init(args=words)
        _run(TraverseServer)
    except (KeyboardInterrupt, ExternalShutdownException):
        return EXIT_OK
    except INPUT_ERRORS as error:
        logger.fatal(str(error))
        return EXIT_BAD_INPUT
    finally:
        rclpy.try_shutdown()
    return EXIT_OK


def _run(make_node: Callable[[], Node]) -> None:
    """Make a node and spin it until the context ends."""
    node = None
    try:
        executor = SingleThreadedExecutor()
        node = make_node()
        executor.add_node(node)
        gc.collect()
        gc.freeze()  # objects that live as long as the node are excluded from garbage collection
        executor.spin()
    except Exception as error:
        # A signal during the start ends the context, and the rest of the start then fails.
        if rclpy.ok():
            raise
        raise ExternalShutdownException from error
    finally:
        if node is not None:
            node.destroy_node()


if __name__ == "__main__":
    sys.exit(main())
