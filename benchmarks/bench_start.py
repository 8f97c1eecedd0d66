# SPDX-License-Identifier: Apache-2.0
"""Times the start of the server up to its first answer, without and with cached kernels.

The time includes DDS discovery. The cold start compiles into a separate folder, so that the
cached kernels remain in place. The start of the command line is timed, too.
"""

import statistics
import tempfile
import time
from pathlib import Path

from benchmarks.bench_service import GOAL, START
from benchmarks.grounds import straight
from benchmarks.measure import Figure, run_predict
from benchmarks.processes import SERVER, memory_of, open_nodes
from rover_planner.worlds.mars_terrain import make_mars_terrain

STARTS = 5
"""Warm starts, of which the median counts."""
WAYPOINTS = 300
"""Waypoints of the path that the command line judges."""


def measure() -> list[Figure]:
    """Measure warm starts, the first of which is not counted, a cold one, and the command line."""
    start_and_ask()
    starts = [start_and_ask() for _ in range(STARTS)]
    warm, memory = (statistics.median(values) for values in zip(*starts, strict=True))
    return [
        Figure("start", "to the first answer, kernels cached", warm, "s", 2.0, repeats=STARTS),
        measure_cold_start(),
        Figure("start", "peak memory of the server", memory, "MB", 400.0, repeats=STARTS),
        measure_command(),
    ]


def start_and_ask(**environment: str) -> tuple[float, float]:
    """Return the time from starting a server to its first answer [s], and its memory [MB]."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    with open_nodes() as nodes:
        client = nodes.client()
        began = time.perf_counter()
        server = nodes.start(SERVER, environment, terrain_file=ground)
        assert client.first_plan(START, GOAL).poses, "the path is to be passable"
        taken = time.perf_counter() - began
        for _ in range(20):
            client.plan(START, GOAL)
        time.sleep(0.5)
        return taken, memory_of(server, "VmHWM")


def measure_cold_start() -> Figure:
    """Measure a start that finds nothing compiled."""
    with tempfile.TemporaryDirectory() as cache:
        cold, _ = start_and_ask(NUMBA_CACHE_DIR=cache)
    return Figure("start", "to the first answer, nothing compiled", cold, "s", repeats=1)


def measure_command() -> Figure:
    """Measure the CPU time of `rover_planner predict` for a short path, imports included."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    poses = straight(0.02 * WAYPOINTS, y=-6.0)[:WAYPOINTS]
    with tempfile.TemporaryDirectory() as name:
        times = [run_predict(Path(name), ground, poses).cpu for _ in range(1 + STARTS)]
    name = f"predict of {WAYPOINTS} waypoints, CPU time"
    return Figure("start", name, statistics.median(times[1:]), "s", 0.7, repeats=STARTS)
