# SPDX-License-Identifier: Apache-2.0
"""The service ~/advise of the traverse server, and ~/advice, which grows as levers are tried."""

from collections.abc import Callable
from functools import partial
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Trigger

from msg_adapters.results.diagnostics import to_json
from rover_planner.advice.advise import Advice, grow_within, refuse
from rover_planner.advice.case import case_of
from rover_planner.nodes.question_desk import QuestionDesk
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.budget import STOPPING, Budget
from rover_planner.planning.answering.judgement import PathJudgement
from rover_planner.planning.answering.question_queue import Asked, QuestionQueue
from rover_planner.planning.answering.questions import Question
from rover_planner.ros.deferred import Reply, serve_later
from rover_planner.ros.node import RoverNode
from rover_planner.ros.qos import latched_qos

NOTHING_REFUSED = "no path was refused yet; ask ~/can_traverse or ~/check_path first"


class AdviceTopics:
    """Seeks advice on the path that was refused last, in a thread that gives way to questions."""

    def __init__(self, node: RoverNode[TraverseServerParameters], desk: QuestionDesk):
        self._node, self._desk = node, desk
        self._refused: PathJudgement | None = None
        self._growing = node.create_publisher(String, "~/advice", latched_qos())
        self._queue = QuestionQueue(
            lambda sought: sought.question.judge(sought.budget.check),
            node.handover.call,
            node.guard.report,
        )
        serve_later(node, Trigger, "~/advise", self._advise)

    def take(self, judgement: PathJudgement) -> None:
        """Note a judgement, which advice is to be about if it refuses a path."""
        if not judgement.traversable and judgement.candidate is not None:
            self._refused = judgement

    def cancel(self, code: str, reason: str) -> int:
        """Refuse advice that is in work; return the number of them."""
        return self._queue.stop_all(code, reason)

    def close(self) -> None:
        """Refuse advice that is in work and end the thread."""
        self.cancel(STOPPING, "the server is shutting down")
        self._queue.close()

    def _advise(self, _request: Trigger.Request, response: Trigger.Response, reply: Reply) -> None:
        def answer(found: Advice | dict[str, Any]) -> None:
            if isinstance(found, Advice):
                self._publish(found)
                response.success, report = bool(found.found), found.to_dict()
                self._node.get_logger().info(f"advise: {found.describe()}")
            else:
                response.success, report = False, found
                self._node.get_logger().warning(f"advise: {found['reason']}")
            response.message = to_json(report)
            reply(response)

        question = Question("advise", "", partial(self._seek, self._refused), refuse)
        budget = Budget(self._node.values.advice_time)
        self._queue.ask(Asked(question, budget, answer), max_waiting=0)

    def _seek(
        self, refused: PathJudgement | None, check: Callable[[], object]
    ) -> Advice | dict[str, Any]:
        """Return advice, and publish it as it grows; called in the thread."""
        if refused is None:
            return refuse("no_path", NOTHING_REFUSED)
        judge, candidate, told = refused.judge, refused.candidate, None
        assert judge is not None and candidate is not None
        case = case_of(judge.site, candidate.poses)
        for advice in grow_within(case, lambda: self._desk.give_way(check)):
            if told is None or len(advice.found) > len(told.found):
                self._node.handover.call(partial(self._publish, advice))
            told = advice
        assert told is not None
        return told

    def _publish(self, advice: Advice) -> None:
        self._growing.publish(String(data=to_json(advice.to_dict())))
