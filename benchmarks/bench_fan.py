"""Times large sets of poses: JPL's ENav fan of 1,694 paths, and a map of a million cells."""

import resource
import statistics
import time

import numba
import numpy as np

from benchmarks.measure import REPEATS, Figure, median_time, median_times
from rover_physics.prediction.map_sweep import score_poses, sweep_map
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.worlds.mars_terrain import make_mars_terrain

ARCS = (14, 11, 11)
"""Number of curvatures on the first, second and third arc of a path, as in ENav."""
REACH = 6.0
"""Length of a path [m]."""
SPACING = 0.25
"""Distance between poses along a path [m]."""
TURN = 0.35
"""Largest curvature [1/m]."""
MAP_CELLS = 1_000
"""Cells along each side of the map."""
MAP_ROWS = (100, 180)
"""First and last row of the part that is timed; the map is uniform except at its edges."""


def enav_fan(start: float) -> np.ndarray:
    """Return poses (40656, 3): 14 x 11 x 11 paths of three arcs, 24 poses each, from x = start."""
    steps = round(REACH / SPACING)
    counts = [np.linspace(-TURN, TURN, count) for count in ARCS]
    first, second, third = (grid.ravel() for grid in np.meshgrid(*counts, indexing="ij"))
    part = np.arange(steps) * 3 // steps
    curvature = np.choose(part[None], [c[:, None] for c in (first, second, third)])
    yaw = np.cumsum(curvature * SPACING, axis=1)
    x = start + np.cumsum(SPACING * np.cos(yaw), axis=1)
    y = np.cumsum(SPACING * np.sin(yaw), axis=1)
    return np.column_stack([x.ravel(), y.ravel(), yaw.ravel()])


def measure() -> list[Figure]:
    """Measure the fan on one and two threads, and the map."""
    rover = load_rover("lsr1")
    ground = make_mars_terrain(1, 24.0, 0.05)
    fan = enav_fan(-3.0)

    def score_on(threads: int) -> None:
        numba.set_num_threads(threads)
        score_poses(rover, ground, fan)

    figures = [Figure("fan", "poses", len(fan), "", repeats=1)]
    one = median_time(lambda: score_on(1), REPEATS)
    figures.append(Figure("fan", "1,694 paths on one thread, CPU time", one, "s", 0.35))
    if numba.config.NUMBA_NUM_THREADS > 1:
        both = [lambda: score_on(1), lambda: score_on(2)]
        one, two = median_times(both, REPEATS, time.perf_counter)
        against = "one thread by the same clock"
        figures.append(Figure("fan", "1,694 paths on two threads, by the clock", two, "s"))
        figures.append(
            Figure("fan", "how much faster two threads are", one / two, "x", 1.7, True, against)
        )
    return figures + measure_map(rover)


def measure_map(rover) -> list[Figure]:
    """Sweep a map at 8 headings, row by row, until there is enough."""
    ground = make_mars_terrain(2, MAP_CELLS * 0.05, 0.05)
    elevation = ground.elevation[:MAP_CELLS, :MAP_CELLS]
    ground = Terrain(elevation, ground.resolution, ground.origin)
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    rates, before = [], peak_memory()
    began = time.perf_counter()
    for first, scores in sweep_map(rover, ground):
        taken = time.perf_counter() - began
        if MAP_ROWS[0] <= first < MAP_ROWS[1]:
            rates.append(scores.status.size / taken)
        if first >= MAP_ROWS[1]:
            break
        began = time.perf_counter()
    rate, cells = statistics.median(rates), ground.elevation.size
    name = f"map of {MAP_CELLS:,} x {MAP_CELLS:,} cells"
    return [
        Figure("map", f"{name}: poses per second, all threads", rate, "1/s", repeats=len(rates)),
        Figure("map", f"{name}: 8 headings take", 8 * cells / rate, "s", repeats=len(rates)),
        Figure("map", f"{name}: memory for it", peak_memory() - before, "MB", repeats=1),
        Figure("map", "peak memory of the process", peak_memory(), "MB", repeats=1),
    ]


def peak_memory() -> float:
    """Return the peak memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
