# SPDX-License-Identifier: Apache-2.0
"""Times how soon ~/stop is heard after a map with a wall across the watched path was published.

The server runs in a process of its own. The first stop of the process and the median of the others
count, each for maps of several sizes, exact and with standard deviations.
"""

import time
from statistics import median

from benchmarks.measure import Figure
from benchmarks.processes import SERVER, START_TIME, open_nodes
from msg_adapters.elevation import terrain_to_point_cloud
from support.grounds import make_terrain, wall_at, waves, with_std
from support.planner_client import GOAL, START, PlannerClient
from support.waiting import wait_until

MAPS = ((6.0, 0.05, 0.0), (6.0, 0.05, 0.001), (15.0, 0.02, 0.0), (15.0, 0.02, 0.001))
"""Half width, cell size and standard deviation of the heights of each map [m]."""
REPEATS = 8
LIMIT = 500.0
"""Longest allowed time from map to stop [ms]."""


def measure() -> list[Figure]:
    """Measure the stops of each map in a server of its own."""
    return [figure for size in MAPS for figure in _measure(*size)]


def _measure(half: float, resolution: float, std: float) -> list[Figure]:
    clouds = []
    for height in (waves, wall_at(1.05)):
        ground = make_terrain(height, resolution, half)
        ground = with_std(ground, std) if std else ground
        clouds.append(terrain_to_point_cloud(ground, "map"))
    with open_nodes() as nodes:
        client = nodes.ros.spin(PlannerClient(nodes.ros))
        client.stand(START)
        nodes.start(SERVER, monitor=True, monitor_timeout=60.0)
        wait_until(lambda: client.stops, "the server", START_TIME)
        delays = [_time_stop(client, clouds) for _ in range(REPEATS)]
    cells, later = f"{ground.elevation.size:,} cells", delays[1:]
    cells += ", with elevation_std" if std else ""
    return [
        Figure("stop", f"first stop, {cells}", delays[0], "ms", LIMIT, repeats=1),
        Figure("stop", f"later stops, {cells}", median(later), "ms", LIMIT, repeats=len(later)),
    ]


def _time_stop(client: PlannerClient, clouds: list) -> float:
    """Have a path accepted, block it, and return the time until the stop is heard [ms]."""
    client.logs.clear()
    client.send_cloud(clouds[0])
    wait_until(lambda: client.can_traverse(START, GOAL).poses, "a path")
    client.wait_for_stop(False)
    time.sleep(0.3)
    sent = time.monotonic()
    client.send_cloud(clouds[1])
    client.wait_for_stop()
    return 1e3 * (next(at for stops, at in client.stops if stops and at > sent) - sent)
