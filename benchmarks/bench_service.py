# SPDX-License-Identifier: Apache-2.0
"""Times `~/can_traverse` over DDS between two processes: 10 m, 2 cm between waypoints.

Three answers are timed in turns: the server's, that of a node that returns the same plan without
computing it, and the same query in this process without ROS. Everything is measured twice: with a
pause before each query (processors sleep and caches are cold), and without a pause, as by a
planner that sends the next query as soon as it has an answer. A map message is timed, too.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.grounds import made_square
from benchmarks.measure import Figure, median_times
from benchmarks.processes import ECHO, SERVER, open_nodes
from msg_adapters.elevation import terrain_from_point_cloud, terrain_to_point_cloud
from rover_physics import Terrain, load_rover
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.query import Site
from rover_planner.worlds.mars_terrain import make_mars_terrain

START, GOAL = (-5.0, -6.0, 0.0), (5.0, -6.0, 0.0)
"""Poses x, y [m], yaw [rad]. The path crosses some rocks, so that contact points jump."""
QUESTIONS = 200
"""Timed queries to each responder."""
WARM_UP = 20
"""Queries before these that are not timed."""
NINES = 50
"""Questions with nine candidates."""
CELLS = 1_000
"""Cells along each side of the map that is sent."""
ASKERS = (("after a pause", 0.03, 1), ("at once", 0.0, 20))
"""Name, pause before a query [s], and queries to one responder before the next has its turn."""


def measure() -> list[Figure]:
    """Measure one path with and without a pause, a fan of nine, and a map message."""
    rover, ground = load_rover("lsr1"), make_mars_terrain(1, 24.0, 0.05)
    judge, figures = PathJudge(Site(rover, ground, PathQueryOptions(count=1))), []
    with open_nodes() as nodes:
        nodes.start(SERVER, terrain_file=ground, candidate_count=1)
        client = nodes.client()
        plan = client.first_plan(START, GOAL)
        assert plan.poses, "the path is to be passable"
        nodes.start_echo(plan)
        client.first_plan(START, GOAL, ECHO)
        responders: dict[str, Callable[[], object]] = {
            "server": lambda: client.plan(START, GOAL),
            "echo": lambda: client.plan(START, GOAL, node=ECHO),
            "computation": lambda: judge.search(START, GOAL),
        }
        for name, pause, in_a_row in ASKERS:
            times = ask_in_turns(responders, pause, in_a_row)
            figures += make_figures(name, times, len(plan.poses))
    return [*figures, measure_nine(ground), measure_map_message()]


def ask_in_turns(
    responders: dict[str, Callable[[], object]], pause: float, in_a_row: int
) -> dict[str, list[float]]:
    """Return the times [s] of each responder."""
    times: dict[str, list[float]] = {name: [] for name in responders}
    for _ in range((WARM_UP + QUESTIONS) // in_a_row):
        for name, ask in responders.items():
            if not pause:
                ask()  # not counted: the caches hold another responder's data
            times[name] += [_time(ask, pause) for _ in range(in_a_row)]
    return {name: taken[WARM_UP:] for name, taken in times.items()}


def _time(ask: Callable[[], object], pause: float) -> float:
    time.sleep(pause)
    began = time.perf_counter()
    ask()
    return time.perf_counter() - began


def make_figures(asked: str, times: dict[str, list[float]], poses: int) -> list[Figure]:
    """Return the figures of the times [s] of all responders."""
    middle = {name: 1e3 * statistics.median(values) for name, values in times.items()}
    late = 1e3 * float(np.quantile(times["server"], 0.99, method="inverted_cdf"))
    overhead = middle["server"] - middle["echo"] - middle["computation"]
    rows = [
        (f"p50, one path, {poses} poses back", middle["server"], "ms", 6.0),
        ("p99 / p50", late / middle["server"], "x", 2.0),
        ("p50 of an echo of the plan", middle["echo"], "ms", None),
        ("p50 of the computation", middle["computation"], "ms", None),
        ("p50 - computation - echo", overhead, "ms", 1.0),
    ]
    return [
        Figure("service", f"{asked}: {name}", *rest, repeats=QUESTIONS) for name, *rest in rows
    ]


def measure_nine(ground: Terrain) -> Figure:
    """Measure the query with the default of nine candidates."""
    with open_nodes() as nodes:
        nodes.start(SERVER, terrain_file=ground)
        client, pause = nodes.client(), ASKERS[0][1]
        client.first_plan(START, GOAL)
        times = [_time(lambda: client.plan(START, GOAL), pause) for _ in range(NINES + 10)]
    middle = 1e3 * statistics.median(times[10:])
    return Figure("service", "p50, nine candidates", middle, "ms", repeats=NINES)


def measure_map_message() -> Figure:
    """Measure a cloud of a million points, row by row and with holes, until it is a terrain."""
    ground = made_square(2, CELLS)
    holes = np.random.default_rng(0).random(ground.elevation.shape) < 0.02
    ground = replace(ground, elevation=np.where(holes, np.nan, ground.elevation))
    cloud = terrain_to_point_cloud(ground, "map")
    (taken,) = median_times([lambda: terrain_from_point_cloud(cloud)], clock=time.perf_counter)
    return Figure("map message", "1,000 x 1,000 points row by row", 1e3 * taken, "ms", 30.0)
