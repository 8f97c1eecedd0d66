# SPDX-License-Identifier: Apache-2.0
"""Takes the questions of a node's services and has them judged, within their budget.

The course of a question: a service makes a `Question` of its request; the desk notes when it came
and what is known then; the queue judges it in its thread; the desk hands the judgement to the
service, which makes messages of it.
"""

import contextlib
import math
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Header

from msg_adapters.results.diagnostics import SEARCH, make_status
from rover_planner.nodes.map_topics import MapTopics
from rover_planner.planning.answering.budget import STOPPING, Budget
from rover_planner.planning.answering.question_queue import Asked, QuestionQueue
from rover_planner.planning.answering.questions import Question, Register
from rover_planner.planning.answering.search_watch import NewerMapError, SearchWatch
from rover_planner.planning.answering.server_health import ServerHealth
from rover_planner.planning.answering.snapshot import Snapshot
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.verdict_report import IdentityReport
from rover_planner.ros.deferred import PacedSender
from rover_planner.ros.node import RoverNode, create_steady_timer
from rover_planner.ros.qos import topic_qos

LEAVE_TIME = 0.1
"""Time in which the last answers leave before the node is destroyed [s]."""
PATROL = 0.05
"""Period of the check for questions that have run out of time [s]."""
WAIT = 0.01
"""Time between two looks of a thread that gives way to questions [s]."""
GRACE = 0.1
"""Time after its deadline in which a question in work may still end by itself [s]."""


Reply = Callable[[Any, IdentityReport], None]
"""Makes messages of a judgement, a `PathJudgement` or `ReachAnswer`, and of what it is about, and
sends them; called once, in the executor's thread."""


@dataclass(eq=False, kw_only=True)
class Inquiry(Asked):
    """A question that came to a node."""

    snapshot: Snapshot
    """Map, settings, path and measurements; its map is that of the time of judging."""
    arrival: float
    """Time of its arrival [s], steady clock."""
    last_map: Future[None]
    """Done when the maps that had come until then are taken."""


class QuestionDesk:
    """Numbers questions, queues them, and delivers each answer once."""

    def __init__(self, node: RoverNode[Any], service: TraverseService, maps: MapTopics):
        """Begin without questions."""
        self._node, self._service, self._maps = node, service, maps
        self._sender = PacedSender(node, node.guard)
        self._register = Register()
        self.health = ServerHealth()
        """Counts of answers and faults."""
        self._queue = QuestionQueue(self._judge, node.handover.call, node.guard.report)
        self._progress = node.create_publisher(DiagnosticArray, "~/search_progress", topic_qos())
        self._patrol = create_steady_timer(node, PATROL, self._refuse_overdue, starts=False)

    @property
    def open_count(self) -> int:
        """Number of questions without an answer."""
        return self._queue.open_count

    def ask(self, question: Question, reply: Reply) -> None:
        """Take a question; its answer follows within its budget and GRACE."""
        self._node.heard.poll()
        values = self._service.settings.parameters
        inquiry = Inquiry(
            question,
            Budget(values.time_budget),
            lambda judgement: self._answer(inquiry, judgement, reply),
            snapshot=replace(self._service.snapshot(self._ros_time), watch=self._watch()),
            arrival=time.monotonic(),
            last_map=self._maps.last_job,
        )
        self._queue.ask(inquiry, values.max_waiting)
        if self._queue.open_count:
            self._patrol.reset()

    @property
    def _ros_time(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _judge(self, inquiry: Inquiry) -> Any:
        """Return the judgement of a question on the newest map; called in the queue's thread."""
        self._maps.wait(inquiry.last_map, inquiry.budget.check)
        while True:
            inquiry.snapshot = self._service.add_map(inquiry.snapshot, self._ros_time)
            with contextlib.suppress(NewerMapError):
                return inquiry.question.judge(inquiry.snapshot)

    def _answer(self, inquiry: Inquiry, judgement: Any, reply: Reply) -> None:
        """Hand the answer to a question to its service."""
        question, done = inquiry.question, time.monotonic()
        identity = self._register.identify(question.service, question.hash, inquiry.snapshot)
        label = f"{identity.request}, {question.service}"
        self.health.take_answer(judgement.code, done, label, done - inquiry.arrival)
        self._sender.send(partial(reply, judgement, identity))
        if not self._queue.open_count:
            self._patrol.cancel()

    def _watch(self) -> SearchWatch:
        """Return a watch that publishes the progress of a question's searches."""
        patience = self._service.settings.lattice.budget

        def send_report(report: dict[str, Any]) -> None:
            self._node.handover.call(lambda: self._publish_progress(report))

        return SearchWatch(lambda: self._service.known_map, send_report, patience)

    def _publish_progress(self, report: dict[str, Any]) -> None:
        text = (
            "a path is found, a better one is searched" if report["found"] else "no path found yet"
        )
        name = self._service.settings.rover.name
        header = Header(stamp=self._node.get_clock().now().to_msg())
        status = make_status(SEARCH, "ok", text, report, name)
        self._progress.publish(DiagnosticArray(header=header, status=[status]))

    def identify(self, service: str, path_hash: str, snapshot: Snapshot) -> IdentityReport:
        """Return a new number with what a judgement that nobody asked for is about."""
        identity = self._register.identify(service, path_hash, snapshot)
        return replace(identity, path_hash=path_hash)

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
        return self._queue.stop_all(code, reason)

    def close(self) -> None:
        """Refuse all open questions and end the thread; the refusals have time to leave."""
        count = self.cancel(STOPPING, "the server is shutting down")
        self._queue.close()
        self._sender.send_all()
        if count:
            time.sleep(LEAVE_TIME)

    def _refuse_overdue(self) -> None:
        self._queue.refuse_overdue(GRACE)
        self._queue.finish()
