"""Times the update of a hazard map where its map has changed."""

import time
from dataclasses import replace

import numpy as np

from benchmarks.measure import Figure
from rover_physics.numerics.interruption import interruptible
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.navigation.hazard_map import HazardMap
from rover_planner.planning.navigation.pose_classes import RoverOnMap
from rover_planner.worlds.mars_terrain import make_mars_terrain

CELLS = 1_000
"""Cells along each side of the map."""
CHANGE = 200
"""Cells along each side of the part that changes."""
HEADINGS = 8
"""Headings of the hazard map."""
RESOLUTION = 0.05
"""Cell size [m]."""
REPEATS = 3
"""Measured updates."""
TARGET = 2.0
"""Time of an update on two cores [s]."""


def measure() -> list[Figure]:
    """Measure an update on smooth waves and on Mars-like ground."""
    mars = make_mars_terrain(1, CELLS * RESOLUTION, RESOLUTION)
    figures = []
    for name, ground in (("waves", make_waves()), ("Mars-like", mars)):
        figures += measure_update(name, ground)
    return figures


def measure_update(name: str, ground: Terrain) -> list[Figure]:
    """Lift a part in the middle of the map by a smooth bump, and update the hazard map.

    Only what the change can reach is judged, so the rest need not have been judged before. The
    median of REPEATS updates counts, after one that loads the kernels as a node does at its start.
    """
    rover, options = load_rover("lsr1"), SweepOptions(control_margin=0.3)
    before = RoverOnMap(rover, ground, options)
    after = RoverOnMap(rover, replace(ground, elevation=lift(ground.elevation)), options)
    updates = [update(before, after) for _ in range(1 + REPEATS)][1:]
    poses, taken, clock, cpu = np.median(updates, axis=0).tolist()
    return [
        Figure("hazards", f"{name}: poses that a change of {CHANGE} x {CHANGE} cells reaches",
               round(poses), "", repeats=1),
        Figure("hazards", f"{name}: finding them", taken, "s", repeats=REPEATS),
        Figure("hazards", f"{name}: update, CPU time", cpu, "s", repeats=REPEATS),
        Figure("hazards", f"{name}: update on all cores, by the clock", clock, "s", TARGET,
               repeats=REPEATS),
    ]  # fmt: skip


def update(before: RoverOnMap, after: RoverOnMap) -> tuple[int, float, float, float]:
    """Return the number of poses of an update, and the times to find them and of all of it [s]."""
    hazards = HazardMap(HEADINGS)
    hazards.take(before)
    hazards._stale[:] = False  # as if they were judged
    begin, used = time.perf_counter(), time.process_time()
    hazards.take(after)
    taken, poses = time.perf_counter() - begin, hazards.stale_count
    with interruptible(lambda: None):  # as in the node
        hazards.work(1e9)
    return poses, taken, time.perf_counter() - begin, time.process_time() - used


def lift(elevation: np.ndarray) -> np.ndarray:
    """Return heights with a smooth bump of 5 cm in the middle."""
    lifted = elevation.copy()
    rows, columns = (slice((n - CHANGE) // 2, (n + CHANGE) // 2) for n in elevation.shape)
    bump = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(CHANGE) + 0.5) / CHANGE)
    lifted[rows, columns] += 0.05 * bump[:, None] * bump
    return lifted


def make_waves() -> Terrain:
    """Return smooth waves."""
    y, x = np.indices((CELLS, CELLS)) * RESOLUTION
    return Terrain(0.04 * np.sin(1.3 * x) + 0.03 * np.sin(1.7 * y), RESOLUTION, (0.0, 0.0))
