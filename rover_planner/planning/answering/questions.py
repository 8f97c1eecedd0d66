# SPDX-License-Identifier: Apache-2.0
"""The questions of the services, what the answer to each is about, and the queue that judges them.

They are judged one after another in a thread, each within its time budget.
"""

import secrets
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from queue import SimpleQueue
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.errors import RoverError
from rover_physics.numerics.interruption import interruptible
from rover_physics.traversability.reach import ReachAnswer, judge_reach
from rover_planner.maps.known_map import stamp_text
from rover_planner.parameters.traverse_server import USE
from rover_planner.planning.answering.budget import BUSY, TOO_LONG, Budget, QuestionStoppedError
from rover_planner.planning.answering.judgement import (
    LEARNED,
    TOLD,
    IdentityReport,
    PathJudgement,
    refusal,
    refuse_for,
)
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot

HOPELESS = 0.02
"""Share of its time that a waiting question must have left to be worth waiting for."""
END_TIME = 2.0
"""Longest wait for the thread when the queue is closed [s]."""


@dataclass(frozen=True, eq=False)
class PathQuestion:
    """Whether there is a path from start to goal."""

    start: ArrayLike = ()
    """(3,) x, y [m], yaw [rad] of the body, map frame."""
    goal: ArrayLike = ()
    """(3,) x, y [m], yaw [rad] of the body, map frame."""
    tolerance: float = 0.0
    """As in `Snapshot.answer` [m]."""
    hash: str = ""
    """Hash of the request; empty if it has none."""
    refusal: str = ""
    """Why the request cannot be read, which is the answer then; empty if it can."""

    def judge(self, snapshot: Snapshot) -> PathJudgement:
        """Find a path; errors are those of `Snapshot.answer`."""
        if self.refusal:
            return refusal("bad_request", self.refusal)
        return snapshot.answer(self.start, self.goal, self.tolerance).complete()


@dataclass(frozen=True, eq=False)
class ReachQuery:
    """Whether the tool reaches the last target with the last wrench, or why they were refused."""

    target: NDArray[np.float64] | None = None
    """Target (3,) of the tip [m], map frame; None if there is none or it was refused."""
    target_refusal: str = "no target was received yet; publish one on ~/tool_target"
    """Reason why there is no target: a later query must not use an outdated one."""
    force: NDArray[np.float64] | None = None
    """Force (3,) [N] on the tip, map frame; None if there is none."""
    moment: NDArray[np.float64] | None = None
    """Moment (3,) [N m] on the tip, map frame; None if there is none."""
    wrench_refusal: str = ""
    """Reason why the last wrench was refused; queries are refused until a valid one arrives."""
    hash: str = ""
    """Hash of the request, which has none."""

    def judge(self, snapshot: Snapshot) -> ReachAnswer | PathJudgement:
        """Judge the rover at the last pose of the last path with its tool at the target.

        Raises:
            RoverError: The rover has no arm, or the model refuses an option.
        """
        path, missing = snapshot.path, snapshot.refuse_map()
        if path.poses is None:
            return refusal(path.code, path.refusal)
        if missing is not None:
            return missing
        if self.target is None:
            return refusal("no_target", self.target_refusal)
        if self.wrench_refusal:
            return refusal("no_wrench", self.wrench_refusal)
        settings = snapshot.settings
        joints = settings.manipulator_joints
        unknown = [name for name in joints if name not in snapshot.joints]
        if 0 < len(unknown) < len(joints):
            text = f"joint_states has never had {', '.join(unknown)}, but other joints of the arm"
            return refusal("missing_joints", f"{text}; it must have all of them, or none")
        assert snapshot.terrain is not None
        return judge_reach(
            settings.rover,
            snapshot.terrain,
            path.poses[-1],
            self.target,
            settings.query.model,
            force=self.force,
            moment=self.moment,
        )


Question = PathQuestion | GivenPath | ReachQuery
"""What a service asks. It judges itself by a snapshot; a RoverError refuses it."""


@dataclass
class Register:
    """Numbers the answers of a server, and says what each is about."""

    server: str = field(default_factory=lambda: secrets.token_hex(4))
    """Random text of this run of the server."""
    count: int = 0
    """Number of the last answer."""

    def identify(self, service: str, question: Question, snapshot: Snapshot) -> IdentityReport:
        """Return what the answer to the next question is about.

        Args:
            service: Name of the service that was called.
            question: The question.
            snapshot: What was known when it was asked.
        """
        self.count += 1
        path = question if isinstance(question, GivenPath) else GivenPath()
        known = snapshot.known_map
        content, stamp = (
            ("", "") if known is None else (known.fingerprint, stamp_text(known.stamp))
        )
        about = self.count, service, self.server, question.hash, path.hash, path.stamp
        identity = IdentityReport(*about, content, stamp, snapshot.map_age)
        ground = snapshot.ground
        if ground is None:
            return identity
        return replace(
            identity,
            ground=LEARNED if snapshot.settings.parameters.learn == USE else TOLD,
            ground_friction=ground.mean,
            ground_friction_std=ground.std,
            ground_since=ground.since,
            ground_classes={str(c): mu for c, mu in snapshot.class_friction.items()},
        )


@dataclass(eq=False)
class Asked:
    """A question that was asked."""

    service: str
    """Name of the service that was asked."""
    budget: Budget
    """Its time."""
    has_begun: bool = False
    """True if the thread has begun to judge it."""


One = TypeVar("One", bound=Asked)
Judgement = TypeVar("Judgement")


class QuestionQueue(Generic[One, Judgement]):
    """Judges questions in their order; refuses those that it has no place or no time for.

    Its methods belong to one thread, the owner's. Each question has one answer: its judgement, or
    a refusal, whichever comes first.
    """

    def __init__(
        self,
        judge: Callable[[One], Judgement],
        wake: Callable[[], object],
        report: Callable[[str, Exception], str],
    ):
        """Start the thread.

        Args:
            judge: Returns the judgement of a question; called in the thread. It may raise: a
                RoverError refuses the request, any other error is one of this program.
            wake: Has the owner's thread take the answers; called in the thread.
            report: Takes the place of an error of this program and the error; returns its text.
        """
        self._judge, self._wake, self._report = judge, wake, report
        self._waiting: SimpleQueue[One | None] = SimpleQueue()
        self._answers: SimpleQueue[tuple[One, Judgement | PathJudgement]] = SimpleQueue()
        self._open: list[One] = []
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    @property
    def open_count(self) -> int:
        """Number of questions whose answer was not taken."""
        return len(self._open)

    def ask(self, asked: One, max_waiting: int) -> None:
        """Queue a question, or refuse it as BUSY if more than that number wait."""
        count = len(self._open)
        self._open.append(asked)
        if count > max_waiting:
            reason = f"{count} questions are open already; ask again later"
            self._answers.put((asked, refusal(BUSY, reason)))
        else:
            self._waiting.put(asked)

    def take_answers(self) -> list[tuple[One, Judgement | PathJudgement]]:
        """Return the questions that have got an answer since the last call, each with it."""
        taken = []
        for _ in range(self._answers.qsize()):
            asked, judgement = self._answers.get()
            if asked in self._open:
                self._open.remove(asked)
                taken.append((asked, judgement))
        return taken

    def refuse_overdue(self, grace: float) -> None:
        """Refuse waiting questions just before their deadline, one in work `grace` [s] after."""
        for asked in self._open:
            budget = asked.budget
            least = -grace if asked.has_begun else HOPELESS * budget.seconds
            if budget.remaining < least:
                self._answers.put((asked, _refuse_late(asked)))

    def stop_all(self, code: str, reason: str) -> int:
        """Refuse all open questions with a code and reason; return their number."""
        for asked in self._open:
            asked.budget.stop(code, reason)
            self._answers.put((asked, refusal(code, reason)))
        return len(self._open)

    def close(self) -> None:
        """End the thread; stop all questions before."""
        self._waiting.put(None)
        self._thread.join(END_TIME)

    def _run(self) -> None:
        while (asked := self._waiting.get()) is not None:
            if asked in self._open:
                self._answers.put((asked, self._find(asked)))
                self._wake()

    def _find(self, asked: One) -> Judgement | PathJudgement:
        """Return the judgement of a question, or its refusal."""
        if asked.budget.stopped is not None:
            return _refuse_late(asked)
        asked.has_begun = True
        try:
            with interruptible(asked.budget.check):
                return self._judge(asked)
        except QuestionStoppedError as error:
            return refusal(error.code, str(error))
        except RoverError as error:
            return refusal("bad_request", str(error))
        except Exception as error:
            return refuse_for(self._report(asked.service, error))


def _refuse_late(asked: Asked) -> PathJudgement:
    """Return the refusal of a question that was stopped, not begun in time, or took too long."""
    stopped = asked.budget.stopped
    if stopped is not None and (asked.has_begun or stopped.code != TOO_LONG):
        return refusal(stopped.code, str(stopped))
    reason = f"others were in work for its time budget of {asked.budget.seconds:g} s; "
    return refusal(BUSY, f"{reason}ask again later")
