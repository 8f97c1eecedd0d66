"""Takes the questions of a node's services and answers them in a thread, within their budget."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from msg_adapters.results.server_status import search_diagnostics
from rover_planner.nodes.maps.map_topics import MapTopics
from rover_planner.planning.answering.budget import Budget
from rover_planner.planning.answering.identity import Register
from rover_planner.planning.answering.question_queue import Question, QuestionQueue
from rover_planner.planning.answering.search_watch import (
    NewerMapError,
    SearchReport,
    SearchWatch,
)
from rover_planner.planning.answering.server_health import ServerHealth
from rover_planner.planning.answering.situation import Situation
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.verdict_report import IdentityReport
from rover_planner.ros.guard import Guard
from rover_planner.ros.handover import Handover
from rover_planner.ros.paced_sender import PacedSender
from rover_planner.ros.qos import topic_qos
from rover_planner.ros.refusals import refuse_error

LEAVE_TIME = 0.1
"""Time in which the last answers leave before the node is destroyed [s]."""
PATROL = 0.05
"""Period of the check for questions that have run out of time [s]."""
GRACE = 0.1
"""Time after its deadline in which a question in work may still end by itself [s]."""


@dataclass(frozen=True)
class Inquiry:
    """A question as a service puts it to the desk."""

    service: str
    """Name of the service, for logs."""
    question_hash: str
    """Hash of the request."""
    answer: Callable[[Situation], Any]
    """Finds the answer, which has a `code`; called in the thread."""
    refuse: Callable[[str, str], Any]
    """Makes an answer of a refusal's code and reason."""
    deliver: Callable[[Any, IdentityReport], None]
    """Sends an answer, with what it is about; called in the executor's thread."""


class QuestionDesk:
    """Numbers questions, queues them, and delivers each answer once."""

    def __init__(self, node: Node, service: TraverseService, maps: MapTopics, guard: Guard):
        self._node, self._service, self._maps = node, service, maps
        self.guard = guard
        """Takes unexpected errors."""
        self._sender = PacedSender(node, guard)
        self._register = Register()
        self._time_budget = 1.0
        self.health = ServerHealth()
        """Counts of answers and faults."""
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._handover = Handover(node, guard)
        self._queue = QuestionQueue(0, lambda: self._handover.call(self._deliver))
        self._progress = node.create_publisher(DiagnosticArray, "~/search_progress", topic_qos())
        self._patrol = node.create_timer(
            PATROL, guard.around(self._refuse_overdue), clock=steady, autostart=False
        )

    @property
    def open_count(self) -> int:
        """Number of questions without an answer."""
        return self._queue.open_count

    def set_limits(self, time_budget: float, max_waiting: int) -> None:
        """Set the time [s] of each question to come, and the number of questions that may wait."""
        self._time_budget = time_budget
        self._queue.max_waiting = max_waiting

    def ask(self, inquiry: Inquiry) -> None:
        """Take a question; its answer follows within its budget and GRACE."""
        now, arrival = self._node.get_clock().now().nanoseconds, time.monotonic()
        situation = replace(self._service.situation(now), watch=self._watch())
        asked = _Asked(self._register.next_number(), situation)
        ticket = self._maps.ticket()

        def answer(budget: Budget) -> Any:
            self._maps.wait(ticket, budget.check)
            while True:
                asked.situation = self._service.add_map(asked.situation, now)
                with contextlib.suppress(NewerMapError):
                    return inquiry.answer(asked.situation)

        def fail(error: Exception) -> Any:
            return refuse_error(self.guard, inquiry.service, error, inquiry.refuse)

        def deliver(given: Any) -> None:
            done, question = time.monotonic(), f"{asked.number}, {inquiry.service}"
            self.health.take_answer(given.code, done, question, done - arrival)
            identity = self._register.identify(
                asked.number, inquiry.service, inquiry.question_hash, asked.situation
            )
            self._sender.send(lambda: inquiry.deliver(given, identity))

        budget = Budget(self._time_budget)
        self._queue.ask(Question(answer, inquiry.refuse, fail, self.guard.around(deliver), budget))
        if self._queue.open_count:
            self._patrol.reset()

    def _watch(self) -> SearchWatch:
        """Return a watch that publishes the progress of a question's searches."""
        patience = self._service.settings.lattice.budget

        def tell(report: SearchReport) -> None:
            self._handover.call(lambda: self._publish_progress(report))

        return SearchWatch(lambda: self._service.known_map, tell, patience)

    def _publish_progress(self, report: SearchReport) -> None:
        text = "a way is found, a better one is searched" if report.found else "no way found yet"
        name = self._service.settings.rover.name
        stamp = self._node.get_clock().now().to_msg()
        self._progress.publish(search_diagnostics(asdict(report), text, name, stamp))

    def identify(self, service: str, path_hash: str, situation: Situation) -> IdentityReport:
        """Return a new number with what a judgement that nobody asked for is about."""
        identity = self._register.identify(
            self._register.next_number(), service, path_hash, situation
        )
        return replace(identity, path_hash=path_hash)

    def cancel(self, code: str, reason: str) -> int:
        """Answer all open questions with a refusal; return their number."""
        return self._queue.stop_all(code, reason)

    def close(self) -> None:
        """Refuse all open questions and end the thread; the refusals have time to leave."""
        is_asked = self.open_count > 0
        self._queue.close()
        self._sender.send_all()
        if is_asked:
            time.sleep(LEAVE_TIME)

    def _deliver(self) -> None:
        self._queue.deliver()
        if not self._queue.open_count:
            self._patrol.cancel()

    def _refuse_overdue(self) -> None:
        self._queue.refuse_overdue(GRACE)
        self._deliver()


@dataclass
class _Asked:
    """A question's number, and the situation in which it is answered."""

    number: int
    situation: Situation
