# SPDX-License-Identifier: Apache-2.0
"""The service ~/advise of the traverse server, and ~/advice, which grows as levers are tried."""

import time
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial

from std_msgs.msg import String
from std_srvs.srv import Trigger

from msg_adapters.results.diagnostics import to_json
from rover_physics.errors import RoverError
from rover_planner.advice.advise import Advice, grow_within
from rover_planner.advice.case import Case, case_of
from rover_planner.nodes.question_desk import QuestionDesk
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.budget import BUSY, CANCELLED, Budget, QuestionStoppedError
from rover_planner.planning.answering.judgement import PathJudgement
from rover_planner.ros.deferred import Reply, serve_later
from rover_planner.ros.node import RoverNode
from rover_planner.ros.qos import latched_qos

NOTHING_REFUSED = "no path was refused yet; ask ~/can_traverse or ~/check_path first"


class AdviceTopics:
    """Seeks advice on the path that was refused last, in a thread that gives way to questions."""

    def __init__(self, node: RoverNode[TraverseServerParameters], desk: QuestionDesk):
        self._node, self._desk = node, desk
        self._refused: PathJudgement | None = None
        self._pool, self._budget = ThreadPoolExecutor(1, "advice"), Budget(0.0)
        self._in_work: Future[None] | None = None
        self._growing = node.create_publisher(String, "~/advice", latched_qos())
        serve_later(node, Trigger, "~/advise", self._advise)

    def take(self, judgement: PathJudgement) -> None:
        """Note a judgement, which advice is to be about if it refuses a path."""
        if not judgement.traversable and judgement.candidate is not None:
            self._refused = judgement

    def cancel(self) -> int:
        """Stop advice that is in work; return the number of them."""
        if self._in_work is None or self._in_work.done():
            return 0
        self._budget.stop(CANCELLED, "the advice was cancelled by ~/cancel")
        return 1

    def close(self) -> None:
        """End the thread."""
        self.cancel()
        self._pool.shutdown()

    def _advise(self, _request: Trigger.Request, response: Trigger.Response, reply: Reply) -> None:
        judgement = self._refused
        if judgement is None:
            self._refuse("no_path", NOTHING_REFUSED, response, reply)
        elif self._in_work is not None and not self._in_work.done():
            self._refuse(BUSY, "other advice is in work; ask again later", response, reply)
        else:
            self._budget = Budget(self._node.values.advice_time)
            work = partial(self._work, _case_of(judgement), self._budget, response, reply)
            self._in_work = self._pool.submit(work)

    def _work(self, case: Case, budget: Budget, response: Trigger.Response, reply: Reply) -> None:
        """Seek advice and hand it on; called in the thread."""
        try:
            told = None
            for advice in grow_within(case, partial(self._give_way, budget)):
                if told is None or len(advice.found) > len(told.found):
                    self._node.handover.call(partial(self._publish, advice))
                told = advice
            assert told is not None
            self._node.handover.call(partial(self._answer, told, response, reply))
        except QuestionStoppedError as error:
            self._hand_refusal(error.code, str(error), response, reply)
        except RoverError as error:
            self._hand_refusal("bad_request", str(error), response, reply)
        except Exception as error:
            self._node.guard.report("advise", error)
            self._hand_refusal("internal_error", str(error), response, reply)

    def _give_way(self, budget: Budget) -> None:
        """Wait while there are questions; raise QuestionStoppedError when the time is over."""
        budget.check()
        while self._desk.open_count:
            time.sleep(0.01)
            budget.check()

    def _publish(self, advice: Advice) -> None:
        self._growing.publish(String(data=to_json(advice.to_dict())))

    def _answer(self, advice: Advice, response: Trigger.Response, reply: Reply) -> None:
        self._publish(advice)
        response.success = bool(advice.found)
        response.message = to_json(advice.to_dict())
        reply(response)
        self._node.get_logger().info(f"advise: {advice.describe()}")

    def _hand_refusal(
        self, code: str, reason: str, response: Trigger.Response, reply: Reply
    ) -> None:
        self._node.handover.call(partial(self._refuse, code, reason, response, reply))

    def _refuse(self, code: str, reason: str, response: Trigger.Response, reply: Reply) -> None:
        nothing = {"code": code, "reason": reason, "remedies": [], "others": [], "complete": False}
        response.success, response.message = False, to_json(nothing)
        reply(response)
        self._node.get_logger().warning(f"advise: {reason}")


def _case_of(judgement: PathJudgement) -> Case:
    """Return the case of a refused path, on the map and with the settings of its judgement."""
    judge, candidate = judgement.judge, judgement.candidate
    assert judge is not None and candidate is not None
    return case_of(judge.rover, judge.terrain, candidate.poses, judge.options)
