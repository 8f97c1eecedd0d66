# SPDX-License-Identifier: Apache-2.0
"""Measures the CPU time of the programs of simulation.launch.py while the rover stands."""

import os
import time
from pathlib import Path

from benchmarks.measure import Figure
from benchmarks.processes import START_TIME, open_nodes
from rover_physics import save_terrain
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.project.launch_files import simulation_commands
from support.waiting import wait_until

SETTLING, SECONDS = 8.0, 30.0
"""Time before the measurement, and its length [s]."""
MOST = {"traverse_server": 3.0, "traction_controller": 8.0, "rover_simulator": 15.0}
"""Aimed at, in percent of a core."""


def measure() -> list[Figure]:
    """Start the programs, leave them alone and measure them."""
    with open_nodes() as nodes:
        terrain = nodes.folder / "ground.npz"
        save_terrain(terrain, make_mars_terrain(1, 24.0, 0.05, rock_cover=0.01))
        commands = simulation_commands(terrain_file=str(terrain))
        found = {name: nodes.start_module(*words[2:]) for name, words in commands.items()}
        graph = nodes.client().connect().node
        wait_until(lambda: set(found) <= set(graph.get_node_names()), "all programs", START_TIME)
        time.sleep(SETTLING)
        before, begin = {name: cpu_time(one.pid) for name, one in found.items()}, time.monotonic()
        time.sleep(SECONDS)
        used = {name: cpu_time(one.pid) - before[name] for name, one in found.items()}
        taken = time.monotonic() - begin
    return [
        Figure("rest", f"{name}: CPU at rest", 100.0 * one / taken, "%", MOST[name], repeats=1)
        for name, one in used.items()
    ]


def cpu_time(pid: int) -> float:
    """Return the CPU time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
