"""Times the start of the server up to its first answer, without and with cached kernels.

The time includes DDS discovery. The cold start compiles into a separate folder, so that the
cached kernels remain in place.
"""

import statistics
import tempfile
import time

from benchmarks.bench_service import GOAL, START
from benchmarks.measure import Figure
from benchmarks.planner_process import SERVER, memory_of, planner_and_processes
from rover_planner.worlds.mars_terrain import make_mars_terrain

STARTS = 5
"""Warm starts, of which the median counts."""
COLD_STARTS = 1


def start_and_ask(**environment: str) -> tuple[float, float]:
    """Return the time from starting a server to its first answer [s], and its memory [MB]."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    with planner_and_processes(**environment) as (planner, processes):
        began = time.perf_counter()
        server = processes.start_server(ground)
        planner.ask(SERVER, START, GOAL)
        taken = time.perf_counter() - began
        for _ in range(20):
            planner.ask(SERVER, START, GOAL)
        time.sleep(0.5)
        return taken, memory_of(server)


def measure() -> list[Figure]:
    """Measure one cold start, then warm starts; the first warm start is not counted."""
    start_and_ask()
    starts = [start_and_ask() for _ in range(STARTS)]
    warm, memory = (statistics.median(values) for values in zip(*starts, strict=True))
    return [
        Figure("start", "to the first answer, kernels cached", warm, "s", 2.0, repeats=STARTS),
        *(measure_cold_start() for _ in range(COLD_STARTS)),
        Figure("start", "peak memory of the server", memory, "MB", 400.0, repeats=STARTS),
    ]


def measure_cold_start() -> Figure:
    """Measure a start that finds nothing compiled."""
    with tempfile.TemporaryDirectory() as cache:
        cold, _ = start_and_ask(NUMBA_CACHE_DIR=cache)
    return Figure("start", "to the first answer, nothing compiled", cold, "s", repeats=1)
