# SPDX-License-Identifier: Apache-2.0
"""Topics and service of the arm in the traverse server: tool target, wrench, `~/check_reach`."""

from dataclasses import replace

from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_srvs.srv import Trigger

from msg_adapters.commands import target_to_point, wrench_to_force_and_moment
from msg_adapters.errors import MessageError
from msg_adapters.results.diagnostics import to_json
from rover_physics.traversability.reach import ReachAnswer
from rover_planner.nodes.question_desk import Answer, QuestionDesk
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.judgement import PathJudgement
from rover_planner.planning.answering.questions import ReachQuery
from rover_planner.ros.node import RoverNode
from rover_planner.ros.subscriptions import subscribe_to_requests


class ArmTopics:
    """Connects a ReachQuery to the topics and the service of a node."""

    def __init__(self, node: RoverNode[TraverseServerParameters], desk: QuestionDesk):
        self._node, self._map_frame = node, node.values.map_frame
        self.query = ReachQuery()
        """The query, with the last target and wrench."""
        for kind, name, take in (
            (PoseStamped, "~/tool_target", self._take_target),
            (WrenchStamped, "~/tool_wrench", self._take_wrench),
        ):
            subscribe_to_requests(node, kind, name, take, node.values.input_reliability)
        desk.serve(Trigger, "check_reach", lambda _: self.query, self._fill)

    def _take_target(self, message: PoseStamped) -> None:
        try:
            self.query = replace(self.query, target=target_to_point(message, self._map_frame))
        except MessageError as error:
            refusal = f"the last target was refused: {error}"
            self.query = replace(self.query, target=None, target_refusal=refusal)
            self._node.get_logger().error(f"~/tool_target refused: {error}")

    def _take_wrench(self, message: WrenchStamped) -> None:
        force = moment = None
        refusal = ""
        try:
            force, moment = wrench_to_force_and_moment(message, self._map_frame)
        except MessageError as error:
            refusal = f"the last wrench was refused: {error}"
            self._node.get_logger().error(f"~/tool_wrench refused: {error}")
        self.query = replace(self.query, force=force, moment=moment, wrench_refusal=refusal)

    def _fill(
        self,
        _request: object,
        response: Trigger.Response,
        answer: Answer[ReachAnswer | PathJudgement],
    ) -> None:
        judged = answer.judgement
        if isinstance(judged, PathJudgement):
            told = {"code": judged.code, "reason": judged.reason}
            report = {"possible": False, "reachable": False, **told}
        else:
            report = judged.to_dict()
        response.success, response.message = report["possible"], to_json(report)
        logger = self._node.get_logger()
        if response.success:
            logger.info("check_reach: possible")
        else:
            logger.warning(f"check_reach: refused ({judged.code}): {judged.reason}")
