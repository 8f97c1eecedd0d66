"""Topics and service of the arm in the traverse server: tool target, wrench, `~/check_reach`."""

from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from msg_adapters.errors import MessageError
from msg_adapters.tools import target_to_point, wrench_to_force_and_moment
from msg_adapters.verdicts import report_to_json
from rover_planner.planning.reach_query import ReachQuery, refuse_reach
from rover_planner.planning.traverse_service import TraverseService
from rover_planner.ros.qos import topic_qos
from rover_planner.ros.refusals import answer_or_refuse


class ReachTopics:
    """Connects a ReachQuery to the topics and the service of a node."""

    def __init__(self, node: Node, service: TraverseService, map_frame: str):
        self._node, self._service, self._map_frame = node, service, map_frame
        self._query = ReachQuery()
        node.create_subscription(PoseStamped, "~/tool_target", self._take_target, topic_qos())
        node.create_subscription(WrenchStamped, "~/tool_wrench", self._take_wrench, topic_qos())
        node.create_service(Trigger, "~/check_reach", self._check_reach)

    @property
    def query(self) -> ReachQuery:
        """The query, with the last target and wrench."""
        return self._query

    def _take_target(self, message: PoseStamped) -> None:
        try:
            self._query.take_target(target_to_point(message, self._map_frame))
        except MessageError as error:
            self._query.refuse_target(str(error))
            self._node.get_logger().error(f"~/tool_target refused: {error}")

    def _take_wrench(self, message: WrenchStamped) -> None:
        try:
            self._query.take_wrench(*wrench_to_force_and_moment(message, self._map_frame))
        except MessageError as error:
            self._query.refuse_wrench(str(error))
            self._node.get_logger().error(f"~/tool_wrench refused: {error}")

    def _check_reach(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        logger = self._node.get_logger()
        answer = answer_or_refuse(
            logger, "check_reach", lambda: self._query.ask(self._service), refuse_reach
        )
        if answer.possible:
            logger.info("check_reach: possible")
        else:
            logger.warning(f"check_reach: refused ({answer.code}): {answer.reason}")
        response.success = answer.possible
        response.message = report_to_json(answer)
        return response
