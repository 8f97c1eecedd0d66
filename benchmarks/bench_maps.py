"""Times merging maps, and how long questions wait for maps that merge meanwhile, in one process.

A node with a loaded map gets local maps of 200 x 200 cells over DDS while a client asks without a
pause. Each question's wait for maps is timed where the server waits; answers are timed at the
client, with and without maps. A busy machine lets everyone wait: how much longer than asked a
thread of the same process sleeps meanwhile is a figure too, and so is the longest wait less the
time in which the question's thread was ready to run and no processor was free (Linux tells it).
"""

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rclpy.parameter import Parameter

from benchmarks.measure import Figure, median_time, quantile
from msg_adapters.elevation import terrain_to_point_cloud
from rover_physics.terrain.grid import Terrain
from rover_physics.warm_up import warm_up
from rover_planner.nodes.traverse_server import SWITCH_INTERVAL, TraverseServer
from rover_planner.worlds.maps.living_map import LivingMap
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.planner_client import PlannerClient
from support.ros_fixtures import RosRun
from support.waiting import wait_until

SIZES = (400, 1000)
"""Cells along each side of the loaded map."""
LOCAL = 200
"""Cells along each side of a local map."""
RESOLUTION = 0.05
"""Cell size [m]."""
SECONDS = 30.0
"""Time of questions, with maps and without [s]."""
PERIOD = 1.0
"""Time between two local maps [s]."""
RUN_DELAY = Path("/proc/thread-self/schedstat")
"""Where Linux tells how long a thread had to wait for a processor."""
LONGEST = 20.0
"""Longest wait of a question for a map that is asked for [ms]."""


def make_prior(cells: int) -> Terrain:
    """Return a loaded map."""
    ground = make_mars_terrain(2, cells * RESOLUTION, RESOLUTION)
    return Terrain(ground.elevation[:cells, :cells], RESOLUTION, ground.origin)


def make_local(prior: Terrain, seed: int) -> Terrain:
    """Return what a sensor sees of a map, somewhere, with noise."""
    rng = np.random.default_rng(seed)
    cells = min(LOCAL, len(prior.elevation) // 2)
    row, column = rng.integers(0, len(prior.elevation) - cells, 2)
    heights = prior.elevation[row : row + cells, column : column + cells].copy()
    heights += rng.normal(0.0, 0.002, heights.shape)
    x, y = prior.origin
    return Terrain(heights, RESOLUTION, (x + RESOLUTION * column, y + RESOLUTION * row))


def merge_time(cells: int) -> float:
    """Return the time to merge a local map into a loaded one [ms]."""
    prior = make_prior(cells)
    living = LivingMap()
    living.load(prior, 0.0)
    stamps = iter(range(10**6))
    local = make_local(prior, 0)

    def merge() -> None:
        living.merge(local, "elevation_cloud", float(next(stamps)))
        living.snapshot()

    return 1e3 * median_time(merge)


def run_delay() -> float:
    """Return how long this thread has been ready to run without a processor [s]; 0 if unknown."""
    try:
        return 1e-9 * float(RUN_DELAY.read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return 0.0


class Stage:
    """A server with a loaded map, and a client."""

    def __init__(self, ros: RosRun, cells: int):
        self.prior = make_prior(cells)
        fixed = [Parameter("map_updates", value="merge"), Parameter("planner", value="fan")]
        self.server: TraverseServer = ros.spin(  # type: ignore[assignment]
            TraverseServer(context=ros.context, parameter_overrides=fixed)
        )
        self.client: PlannerClient = ros.spin(PlannerClient(ros))  # type: ignore[assignment]
        self.client.send_terrain(self.prior)
        self.waits: list[float] = []
        self.own_waits: list[float] = []
        maps = self.server.desk._maps
        wait = maps.wait

        def timed_wait(ticket: int, check: Callable[[], object]) -> None:
            began, delayed = time.perf_counter(), run_delay()
            wait(ticket, check)
            self.waits.append(time.perf_counter() - began)
            self.own_waits.append(self.waits[-1] - (run_delay() - delayed))

        maps.wait = timed_wait  # type: ignore[method-assign]

    def ask_for(self, seconds: float, tell: Callable[[], None]) -> list[float]:
        """Ask for a while; return the times of the answers [s]; `tell` is called before each."""
        x0, x1, y0, y1 = self.prior.bounds
        x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        times = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            tell()
            began = time.perf_counter()
            self.client.can_traverse((x, y, 0.0), (x + 2.0, y, 0.0))
            times.append(time.perf_counter() - began)
        return times


class Sleeper:
    """Sleeps NAP again and again while it is entered, and notes how late it wakes up."""

    NAP = 0.005

    def __enter__(self) -> "Sleeper":
        self.longest, self._ends = 0.0, False
        self._thread = threading.Thread(target=self._sleep, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends = True
        self._thread.join()

    def _sleep(self) -> None:
        while not self._ends:
            began = time.perf_counter()
            time.sleep(self.NAP)
            self.longest = max(self.longest, time.perf_counter() - began - self.NAP)


def measure() -> list[Figure]:
    """Measure merging, waits and answers."""
    figures = [
        Figure("living map", f"{LOCAL} x {LOCAL} merged into {n} x {n} cells", merge_time(n), "ms")
        for n in SIZES
    ]
    warm_up()
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)  # as the program of the node does
    try:
        for cells in SIZES:
            figures += _measure_waits(cells)
    finally:
        sys.setswitchinterval(before)
    return figures


def _measure_waits(cells: int) -> list[Figure]:
    ros = RosRun()
    try:
        stage = Stage(ros, cells)
        alone = stage.ask_for(SECONDS, lambda: None)
        clouds = [
            terrain_to_point_cloud(make_local(stage.prior, seed), "map") for seed in range(8)
        ]
        sent = [0, time.monotonic()]

        def send() -> None:
            if time.monotonic() - sent[1] >= PERIOD:
                stage.client.send_cloud(clouds[sent[0] % len(clouds)])
                sent[:] = [sent[0] + 1, time.monotonic()]

        stage.waits.clear()
        stage.own_waits.clear()
        first = stage.server.service.known_map
        with Sleeper() as sleeper:
            together = stage.ask_for(SECONDS, send)
        wait_until(lambda: stage.server.service.known_map is not first, "a map")
    finally:
        ros.close()
    where = f"into {cells} x {cells} cells"
    rows = (
        ("longest wait for a map", 1e3 * max(stage.waits), LONGEST),
        ("longest wait less that for a processor", 1e3 * max(stage.own_waits), LONGEST),
        ("wait for a map, 99 %", 1e3 * quantile(stage.waits, 0.99), LONGEST),
        ("longest delay of the machine", 1e3 * sleeper.longest, None),
        ("answer without maps, 99 %", 1e3 * quantile(alone, 0.99), None),
        ("answer with maps, 99 %", 1e3 * quantile(together, 0.99), None),
        ("answer without maps, longest", 1e3 * max(alone), None),
        ("answer with maps, longest", 1e3 * max(together), None),
    )
    figures = [
        Figure("living map", f"{name}, {where}", value, "ms", target, repeats=len(together))
        for name, value, target in rows
    ]
    return [*figures, Figure("living map", f"maps sent, {where}", sent[0], "", repeats=1)]
