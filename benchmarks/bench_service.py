"""Times `~/can_traverse` over DDS between two processes: 10 m, 2 cm between waypoints.

Three answers are timed in turns: the server's, that of a node that returns the same plan without
computing it, and the same query in this process without ROS. Everything is measured twice: with a
pause before each query (processors sleep and caches are cold), and without a pause, as by a
planner that sends the next query as soon as it has an answer.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.measure import Figure, quantile
from benchmarks.planner_process import SERVER, Planner, planner_and_processes
from rover_physics.terrain.grid import Terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.worlds.mars_terrain import make_mars_terrain

ECHO = "/echo/can_traverse"
START, GOAL = (-5.0, -6.0, 0.0), (5.0, -6.0, 0.0)
"""Poses x, y [m], yaw [rad]. The path crosses some rocks, so that contact points jump."""
QUESTIONS = 200
"""Timed queries to each responder."""
WARM_UP = 20
"""Queries before these that are not timed."""
NINES = 50
"""Questions with nine candidates."""


@dataclass(frozen=True)
class Asker:
    """The timing of a planner's queries."""

    name: str
    """Name in the table."""
    pause: float
    """Time between an answer and the next query [s]."""
    in_a_row: int
    """Queries to one responder before the next one takes its turn."""


ASKERS = (Asker("after a pause", 0.03, 1), Asker("at once", 0.0, 20))


def make_service(ground: Terrain, parameters: TraverseServerParameters) -> TraverseService:
    """Return the service that a server uses, without ROS."""
    service = TraverseService(load_service_settings(parameters))
    service.take_terrain(ground)
    return service


def ask_in_turns(
    planner: Planner, service: TraverseService, asker: Asker
) -> dict[str, list[float]]:
    """Return the times [s] of "server", "echo" and "computation"."""
    ways: dict[str, Callable[[], object]] = {
        "server": lambda: planner.ask(SERVER, START, GOAL),
        "echo": lambda: planner.ask(ECHO, START, GOAL),
        "computation": lambda: service.answer(START, GOAL),
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range((WARM_UP + QUESTIONS) // asker.in_a_row):
        for name, ask in ways.items():
            if not asker.pause:
                ask()  # not counted: the caches hold another responder's data
            times[name] += [_time(ask, asker.pause) for _ in range(asker.in_a_row)]
    return {name: taken[WARM_UP:] for name, taken in times.items()}


def _time(ask: Callable[[], object], pause: float) -> float:
    time.sleep(pause)
    began = time.perf_counter()
    ask()
    return time.perf_counter() - began


def measure() -> list[Figure]:
    """Measure one path with and without a pause, and a fan of nine."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    service = make_service(ground, TraverseServerParameters(candidate_count=1))
    figures = []
    with planner_and_processes() as (planner, processes):
        processes.start_server(ground, candidate_count=1)
        plan, _ = planner.ask(SERVER, START, GOAL)
        assert plan.poses, "the path is to be passable: " + service.answer(START, GOAL).reason
        processes.start_echo(plan)
        planner.ask(ECHO, START, GOAL)
        for asker in ASKERS:
            times = ask_in_turns(planner, service, asker)
            figures += _tell(asker.name, times, len(plan.poses))
    return [*figures, *_measure_nine(ground)]


def _tell(asked: str, times: dict[str, list[float]], poses: int) -> list[Figure]:
    middle = {name: 1e3 * statistics.median(values) for name, values in times.items()}
    late = {name: 1e3 * quantile(values, 0.99) for name, values in times.items()}
    spread = {name: late[name] / middle[name] for name in times}
    overhead = middle["server"] - middle["echo"] - middle["computation"]
    rows = [
        (f"p50, one path, {poses} poses back", middle["server"], "ms", 6.0),
        ("p99", late["server"], "ms", None),
        ("p99 / p50", spread["server"], "x", 2.0),
        ("p50 of an echo of the plan", middle["echo"], "ms", None),
        ("p99 / p50 of the echo", spread["echo"], "x", None),
        ("p50 of the computation", middle["computation"], "ms", None),
        ("p99 / p50 of the computation", spread["computation"], "x", None),
        ("p50 - computation - echo", overhead, "ms", 1.0),
        ("answers in a second of waiting", 1.0 / statistics.mean(times["server"]), "1/s", None),
    ]
    return [
        Figure("service", f"{asked}: {name}", *rest, repeats=QUESTIONS) for name, *rest in rows
    ]


def _measure_nine(ground: Terrain) -> list[Figure]:
    """Measure the query with the default of nine candidates."""
    with planner_and_processes() as (planner, processes):
        processes.start_server(ground)
        times = []
        for _ in range(NINES + 10):
            time.sleep(ASKERS[0].pause)
            times.append(planner.ask(SERVER, START, GOAL)[1])
    middle = 1e3 * statistics.median(times[10:])
    return [Figure("service", "p50, nine candidates", middle, "ms", repeats=NINES)]
