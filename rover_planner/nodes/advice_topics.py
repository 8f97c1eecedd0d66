# SPDX-License-Identifier: Apache-2.0
"""The service ~/advise of the traverse server, and ~/advice, which grows as levers are tried."""

from dataclasses import dataclass
from functools import partial

from std_msgs.msg import String
from std_srvs.srv import Trigger

from msg_adapters.results.diagnostics import to_json
from rover_physics.numerics.interruption import interruptible
from rover_planner.advice.advise import Advice, grow_advice, refuse
from rover_planner.advice.case import case_of
from rover_planner.nodes.question_desk import QuestionDesk
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.budget import STOPPING, Budget
from rover_planner.planning.answering.judgement import PathJudgement, refusal
from rover_planner.planning.answering.questions import Asked, QuestionQueue
from rover_planner.ros.deferred import Reply, serve_later
from rover_planner.ros.node import RoverNode
from rover_planner.ros.qos import LATCHED_QOS

NOTHING_REFUSED = "no path was refused yet; ask ~/can_traverse or ~/check_path first"


@dataclass(eq=False, kw_only=True)
class AdviceRequest(Asked):
    """A request for advice."""

    refused: PathJudgement | None
    """What it is about; None if no path was refused yet."""
    response: Trigger.Response
    """To be filled."""
    reply: Reply
    """Sends it."""


class AdviceTopics:
    """Seeks advice on the path that was refused last, in a thread that gives way to questions."""

    def __init__(self, node: RoverNode[TraverseServerParameters], desk: QuestionDesk):
        self._node, self._desk = node, desk
        self._refused: PathJudgement | None = None
        self._growing = node.create_publisher(String, "~/advice", LATCHED_QOS)
        wake = partial(node.handover.call, self._deliver)
        self._queue = QuestionQueue(self._seek, wake, node.guard.report)
        serve_later(node, Trigger, "~/advise", self._advise)

    def take(self, judgement: PathJudgement) -> None:
        """Note a judgement, which advice is to be about if it refuses a path."""
        if not judgement.traversable and judgement.candidate is not None:
            self._refused = judgement

    def cancel(self, code: str, reason: str) -> int:
        """Refuse advice that is in work; return the number of them."""
        count = self._queue.stop_all(code, reason)
        self._deliver()
        return count

    def close(self) -> None:
        """Refuse advice that is in work and end the thread."""
        self.cancel(STOPPING, "the server is shutting down")
        self._queue.close()

    def _advise(self, _request: Trigger.Request, response: Trigger.Response, reply: Reply) -> None:
        budget = Budget(self._node.values.advice_time)
        request = AdviceRequest(
            "advise", budget, refused=self._refused, response=response, reply=reply
        )
        self._queue.ask(request, max_waiting=0)
        self._deliver()

    def _deliver(self) -> None:
        """Send what was found, or why nothing was."""
        for request, found in self._queue.take_answers():
            response, logger = request.response, self._node.get_logger()
            if isinstance(found, Advice):
                self._publish(found)
                response.success, report = bool(found.found), found.to_dict()
                logger.info(f"advise: {found.describe()}")
            else:
                response.success, report = False, refuse(found.code, found.reason)
                logger.warning(f"advise: {found.reason}")
            response.message = to_json(report)
            request.reply(response)

    def _seek(self, request: AdviceRequest) -> Advice | PathJudgement:
        """Return advice, and publish it as it grows; called in the thread."""
        refused, check = request.refused, request.budget.check
        if refused is None:
            return refusal("no_path", NOTHING_REFUSED)
        site, candidate, last = refused.site, refused.candidate, None
        assert site is not None and candidate is not None
        with interruptible(lambda: self._desk.give_way(check)):
            for advice in grow_advice(case_of(site, candidate.poses)):
                if last is None or len(advice.found) > len(last.found):
                    self._node.handover.call(partial(self._publish, advice))
                last = advice
        assert last is not None
        return last

    def _publish(self, advice: Advice) -> None:
        self._growing.publish(String(data=to_json(advice.to_dict())))
