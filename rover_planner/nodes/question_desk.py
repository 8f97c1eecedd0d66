# SPDX-License-Identifier: Apache-2.0
"""Takes the questions of a node's services and has them judged, within their budget.

The course of a question: a service reads a `Question` from its request; the desk notes when it
came and what is known then; the queue judges it in its thread; the desk makes an `Answer` of the
judgement, with which the service fills its response.
"""

import math
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Header

from msg_adapters.results.diagnostics import SEARCH, make_status
from rover_physics.traversability.reach import ReachAnswer
from rover_planner.nodes.map_topics import MapTopics
from rover_planner.planning.answering.budget import STOPPING, Budget
from rover_planner.planning.answering.judgement import IdentityReport, PathJudgement, refuse_for
from rover_planner.planning.answering.questions import Asked, Question, QuestionQueue, Register
from rover_planner.planning.answering.server_health import ServerHealth
from rover_planner.planning.answering.snapshot import NewerMapError, SearchWatch, Snapshot
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.ros.deferred import PacedSender, Reply, serve_later
from rover_planner.ros.node import RoverNode, create_steady_timer
from rover_planner.ros.qos import TOPIC_QOS

LEAVE_TIME = 0.1
"""Time in which the last answers leave before the node is destroyed [s]."""
PATROL = 0.05
"""Period of the check for questions that have run out of time [s]."""
WAIT = 0.01
"""Time between two looks of a thread that gives way to questions [s]."""
GRACE = 0.1
"""Time after its deadline in which a question in work may still end by itself [s]."""


Judgement = TypeVar("Judgement")


@dataclass(frozen=True, eq=False)
class Answer(Generic[Judgement]):
    """The answer to a question."""

    question: Question
    """The question."""
    latency: float
    """Time from its arrival to the answer [s]."""
    judgement: Judgement
    """What was found; a `PathJudgement` if it was refused."""
    identity: IdentityReport
    """What it is about."""


@dataclass(eq=False, kw_only=True)
class Inquiry(Asked):
    """A question that came to a node."""

    question: Question
    """The question."""
    take: Callable[[Answer[Any]], None]
    """Takes its answer, once, in the executor's thread."""
    snapshot: Snapshot
    """Map, settings, path and measurements; its map is that of the time of judging."""
    last_map: Future[None]
    """Done when the maps that had come until then are taken."""


class QuestionDesk:
    """Numbers questions, queues them, and delivers each answer once."""

    def __init__(self, node: RoverNode[Any], service: TraverseService, maps: MapTopics):
        """Begin without questions."""
        self._node, self._service, self._maps = node, service, maps
        self._sender = PacedSender(node, node.guard)
        self.register = Register()
        """Numbers the answers."""
        self.health = ServerHealth()
        """Counts of answers and faults."""
        wake = partial(node.handover.call, self._deliver)
        self._queue = QuestionQueue(self._judge, wake, node.guard.report)
        self._progress = node.create_publisher(DiagnosticArray, "~/search_progress", TOPIC_QOS)
        self._patrol = create_steady_timer(node, PATROL, self._refuse_overdue, starts=False)

    @property
    def open_count(self) -> int:
        """Number of questions without an answer."""
        return self._queue.open_count

    def serve(
        self,
        kind: type,
        service: str,
        read: Callable[[Any], Question],
        fill: Callable[[Any, Any, Answer[Any]], None],
    ) -> None:
        """Create a service.

        Args:
            kind: Its type.
            service: Its name.
            read: Returns the question of a request.
            fill: Called with a request, its response and the answer; fills the response. If it
                raises, it is called again, with a refusal for that error.
        """

        def receive(request: Any, response: Any, reply: Reply) -> None:
            def respond(answer: Answer[Any]) -> None:
                try:
                    fill(request, response, answer)
                except Exception as error:
                    text = self._node.guard.report(service, error)
                    fill(request, response, replace(answer, judgement=refuse_for(text)))
                reply(response)

            self.ask(service, read(request), respond)

        serve_later(self._node, kind, f"~/{service}", receive)

    def ask(self, service: str, question: Question, take: Callable[[Answer[Any]], None]) -> None:
        """Take a question of a service; `take` has its answer within its budget and GRACE."""
        self._node.heard.poll()
        values = self._service.settings.parameters
        inquiry = Inquiry(
            service,
            Budget(values.time_budget),
            question=question,
            take=take,
            snapshot=replace(self._service.snapshot(self._ros_time), watch=self._watch()),
            last_map=self._maps.last_job,
        )
        self._queue.ask(inquiry, values.max_waiting)
        self._refuse_overdue()  # many questions put the next patrol off
        if self._queue.open_count:
            self._patrol.reset()

    @property
    def _ros_time(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _judge(self, inquiry: Inquiry) -> PathJudgement | ReachAnswer:
        """Return the judgement of a question on the newest map; called in the queue's thread."""
        self._maps.wait(inquiry.last_map, inquiry.budget.check)
        while True:
            inquiry.snapshot = self._service.add_map(inquiry.snapshot, self._ros_time)
            try:
                return inquiry.question.judge(inquiry.snapshot)
            except NewerMapError:
                continue

    def _deliver(self) -> None:
        """Hand the answers that there are to their services."""
        for asked, judgement in self._queue.take_answers():
            latency = asked.budget.seconds - asked.budget.remaining
            identity = self.register.identify(asked.service, asked.question, asked.snapshot)
            label = f"{identity.request}, {asked.service}"
            self.health.take_answer(judgement.code, time.monotonic(), label, latency)
            answer = Answer(asked.question, latency, judgement, identity)
            self._sender.send(partial(asked.take, answer))
        if not self._queue.open_count:
            self._patrol.cancel()

    def _watch(self) -> SearchWatch:
        """Return a watch that publishes the progress of a question's searches."""
        return SearchWatch(
            lambda: self._service.known_map,
            lambda report: self._node.handover.call(partial(self._publish_progress, report)),
            self._service.settings.lattice.budget,
        )

    def _publish_progress(self, report: dict[str, Any]) -> None:
        text = (
            "a path is found, a better one is searched" if report["found"] else "no path found yet"
        )
        name = self._service.settings.rover.name
        header = Header(stamp=self._node.get_clock().now().to_msg())
        status = make_status(SEARCH, "ok", text, report, name)
        self._progress.publish(DiagnosticArray(header=header, status=[status]))

    def give_way(self, check: Callable[[], object], longest: float = math.inf) -> float:
        """Wait while there are questions; return the time that took [s]; for other threads.

        Args:
            check: Called again and again; may raise.
            longest: Longest wait [s].
        """
        began = time.monotonic()
        check()
        while self.open_count and time.monotonic() - began < longest:
            time.sleep(WAIT)
            check()
        return time.monotonic() - began

    def cancel(self, code: str, reason: str) -> int:
        """Answer all open questions with a refusal; return their number."""
        count = self._queue.stop_all(code, reason)
        self._deliver()
        return count

    def close(self) -> None:
        """Refuse all open questions and end the thread; the refusals have time to leave."""
        count = self.cancel(STOPPING, "the server is shutting down")
        self._queue.close()
        self._sender.send_all()
        if count:
            time.sleep(LEAVE_TIME)

    def _refuse_overdue(self) -> None:
        self._queue.refuse_overdue(GRACE)
        self._deliver()
