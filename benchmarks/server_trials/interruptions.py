"""What reaches a server while it works on a question: requests, signals, and its sudden death."""

import os
import signal
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.server_trials.stage import (
    HEAVY,
    Client,
    LostAnswerError,
    MapSource,
    Stage,
    wait_for_log,
)
from support.grounds import make_terrain, rocky, waves
from support.waiting import wait_until

ANSWER_TIME, PAUSE = 0.2, 0.05
"""Time after which a client asks again without an answer, and after a refusal [s]."""
START, GOAL = (-3.0, 0.0, 0.0), (3.0, 0.5, 0.0)


def start_heavy(stage: Stage) -> tuple[object, Client, Client]:
    """Start a server whose questions take long; return it, an asker, and another client."""
    server = stage.start_ready(make_terrain(waves), time_budget=600.0, **HEAVY)
    return server, stage.client("asker"), stage.client("other")


@dataclass(frozen=True)
class Hearing:
    """Response times while a question is in work [s]."""

    parameter: tuple[float, ...]
    """Of ~/set_parameters."""
    map: tuple[float, ...]
    """From publishing a map until the log says that it is in use."""
    cancel: tuple[float, ...]
    """Of ~/cancel."""
    cancelled: tuple[float, ...]
    """From the call of ~/cancel until the cancelled question's answer."""


def time_hearing(stage: Stage, repeats: int) -> Hearing:
    """Time requests during questions that would take minutes."""
    _, asker, other = start_heavy(stage)
    maps = MapSource(stage.ros)
    grounds = [make_terrain(waves), make_terrain(rocky)]
    parameter, taken, cancel, cancelled = [], [], [], []
    for number in range(repeats):
        future = asker.begin_plan(START, GOAL)
        time.sleep(0.3)
        for k in range(5):
            friction = 0.6 + 0.01 * k
            parameter.append(_time(lambda f=friction: other.set_parameter("friction", f)))
            time.sleep(0.02)
        taken.append(maps.give(grounds[(number + 1) % 2]))
        assert not future.done(), "the question has ended before it was cancelled"
        began = time.perf_counter()
        assert other.cancel().success
        cancel.append(time.perf_counter() - began)
        wait_until(future.done, "the cancelled question")
        cancelled.append(time.perf_counter() - began)
    return Hearing(*map(tuple, (parameter, taken, cancel, cancelled)))


def time_signal(stage: Stage) -> float:
    """Return the time from SIGINT, during a question, to the end of the process [s]."""
    server, asker, _ = start_heavy(stage)
    future = asker.begin_plan(START, GOAL)
    time.sleep(0.5)
    assert not future.done()
    os.kill(server.pid, signal.SIGINT)
    taken = _time(lambda: wait_until(lambda: not server.running, "the end of the server"))
    assert server.exit_code == 0, server.last_words()
    return taken


@dataclass(frozen=True)
class Restart:
    """Times after the start of a server that replaces a killed one [s]."""

    answer: float
    """Until the first answer, which may be that there is no map yet."""
    plan: float
    """Until the first plan, which needs the latched map."""


def time_restart(stage: Stage) -> Restart:
    """Kill a server during a question and start it again; the map is latched by its publisher."""
    maps, ground = MapSource(stage.ros), make_terrain(waves)
    first = stage.start_ready(time_budget=600.0, **HEAVY)
    asker = stage.client("asker")
    maps.give(ground)
    future = asker.begin_plan(START, GOAL)
    time.sleep(0.5)
    assert not future.done()
    os.kill(first.pid, signal.SIGKILL)
    wait_until(lambda: not first.running, "the end of the server")
    began = time.perf_counter()
    second = stage.start_server()
    answer, patience = None, ANSWER_TIME
    while True:
        try:
            plan = asker.plan(START, GOAL, patience)
        except LostAnswerError:
            assert second.running, second.last_words()
            patience *= 1.2  # a busy machine needs more time for an answer
            continue
        answer = answer or time.perf_counter() - began
        if plan.poses:
            wait_for_log(second, "map from elevation_cloud")
            return Restart(answer, time.perf_counter() - began)
        time.sleep(PAUSE)


def _time(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def middle(times: tuple[float, ...]) -> float:
    """Return the median in ms."""
    return 1e3 * statistics.median(times)
