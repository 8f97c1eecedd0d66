"""`~/can_traverse` over DDS between two processes: 10 m, 2 cm between waypoints.

In turns are asked: the server, a node that answers at once with the same plan, and the same
question in this process without ROS. A planner that replans asks now and then, so there is a
pause before each question; how fast answers come without a pause is measured too.
"""

import statistics
import time

from measure import Figure, median_time, quantile
from planner_process import SERVER, Planner, planner_and_processes

from rover_physics.terrain import Terrain
from rover_planner.mars_terrain import make_mars_terrain
from rover_planner.parameters.of_traverse_server import TRAVERSE_SERVER
from rover_planner.traverse_service import TraverseService, settings_from_parameters

ECHO = "/echo/can_traverse"
START, GOAL = (-5.0, -6.0, 0.0), (5.0, -6.0, 0.0)
"""Over ground with some rocks: contacts jump here and there, as on most ways."""
QUESTIONS = 200
WARM_UP = 20
PAUSE = 0.03
"""Time between an answer and the next question [s]."""


def make_service(ground: Terrain, **parameters: object) -> TraverseService:
    """Return what the server knows, without ROS."""
    values = {spec.name: spec.default for spec in TRAVERSE_SERVER} | parameters
    service = TraverseService(settings_from_parameters(values))
    service.take_terrain(ground)
    return service


def ask_in_turns(planner: Planner, service: TraverseService) -> dict[str, list[float]]:
    """Return the times [s] of server, echo and computation."""
    times: dict[str, list[float]] = {"server": [], "echo": [], "computation": []}
    for k in range(WARM_UP + QUESTIONS):
        taken = {}
        for name, topic in (("server", SERVER), ("echo", ECHO)):
            time.sleep(PAUSE)
            taken[name] = planner.ask(topic, START, GOAL)[1]
        time.sleep(PAUSE)
        began = time.perf_counter()
        service.answer(START, GOAL)
        taken["computation"] = time.perf_counter() - began
        for name, value in taken.items():
            if k >= WARM_UP:
                times[name].append(value)
    return times


def measure() -> list[Figure]:
    """Measure one path, and a fan of nine."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    service = make_service(ground, candidate_count=1)
    with planner_and_processes() as (planner, processes):
        processes.start_server(ground, candidate_count=1)
        plan, _ = planner.ask(SERVER, START, GOAL)
        assert plan.poses, "the path is to be passable: " + service.answer(START, GOAL).reason
        processes.start_echo(plan)
        times = ask_in_turns(planner, service)
        hurried = median_time(
            lambda: [planner.ask(SERVER, START, GOAL) for _ in range(20)], clock=time.perf_counter
        )
    figures = _tell(times, len(plan.poses))
    rate = Figure("service", "answers without a pause between", 20.0 / hurried, "1/s", repeats=5)
    return [*figures, rate, *_measure_nine(ground)]


def _tell(times: dict[str, list[float]], poses: int) -> list[Figure]:
    middle = {name: 1e3 * statistics.median(values) for name, values in times.items()}
    late = 1e3 * quantile(times["server"], 0.99)
    echo_late = 1e3 * quantile(times["echo"], 0.99)
    overhead = middle["server"] - middle["echo"] - middle["computation"]
    rows = [
        (f"p50, one path, {poses} poses back", middle["server"], "ms", 6.0),
        ("p99", late, "ms", None),
        ("p99 / p50", late / middle["server"], "x", 2.0),
        ("p50 of an echo of the plan", middle["echo"], "ms", None),
        ("p99 / p50 of that", echo_late / middle["echo"], "x", None),
        ("p50 of the computation", middle["computation"], "ms", None),
        ("p50 - computation - echo", overhead, "ms", 1.0),
    ]
    return [Figure("service", *row, repeats=QUESTIONS) for row in rows]


def _measure_nine(ground: Terrain) -> list[Figure]:
    """Measure the question as the server answers it unless told: with nine candidates."""
    with planner_and_processes() as (planner, processes):
        processes.start_server(ground)
        times = []
        for _ in range(60):
            time.sleep(PAUSE)
            times.append(planner.ask(SERVER, START, GOAL)[1])
    middle = 1e3 * statistics.median(times[10:])
    return [Figure("service", "p50, nine candidates", middle, "ms", repeats=50)]
