# SPDX-License-Identifier: Apache-2.0
"""Times single poses on one core, JPL's ENav fan of 1,694 paths, and a map of a million cells."""

import resource
import statistics
import time

import numba
import numpy as np

from benchmarks.grounds import all_grounds, random_poses
from benchmarks.measure import Figure, median_time, median_times, peak_memory
from rover_physics import Rover, SweepOptions, Terrain, load_rover, score_poses, sweep_map
from rover_planner.worlds.mars_terrain import make_mars_terrain

POSES = 4_000
"""Poses on each ground."""
ARCS = (14, 11, 11)
"""Number of curvatures on the first, second and third arc of a path, as in ENav."""
LENGTH, SPACING = 6.0, 0.25
"""Length of a path of the fan, and distance of its poses [m]."""
TURN = 0.35
"""Largest curvature of the fan [1/m]."""
MAP_CELLS = 1_000
"""Cells along each side of the map."""
MAP_ROWS = (100, 180)
"""First and last row of the part that is timed; the map is uniform except at its edges."""


def measure() -> list[Figure]:
    """Measure poses, the fan and the map."""
    threads, rover = numba.config.NUMBA_NUM_THREADS, load_rover("lsr1")
    numba.set_num_threads(1)
    figures = measure_poses(rover) + measure_fan(rover, threads)
    numba.set_num_threads(threads)
    return figures + measure_map(rover)


def measure_poses(rover: Rover) -> list[Figure]:
    """Measure a pose anywhere on each ground under both policies."""
    figures = []
    for name, ground in all_grounds().items():
        poses = random_poses(ground, POSES)
        calls = [
            lambda p=policy: score_poses(rover, ground, poses, SweepOptions(policy=p))  # noqa: B023
            for policy in ("equal", "optimal")
        ]
        equal, optimal = (1e6 * taken / POSES for taken in median_times(calls))
        figures += [
            Figure("pose", f"{name}: full, equal torques", equal, "us", 8.0),
            Figure("pose", f"{name}: what optimal torques add", optimal - equal, "us", 100.0),
        ]
    return figures


def enav_fan(start: float) -> np.ndarray:
    """Return poses (40656, 3): 14 x 11 x 11 paths of three arcs, 24 poses each, from x = start."""
    steps = round(LENGTH / SPACING)
    counts = [np.linspace(-TURN, TURN, count) for count in ARCS]
    first, second, third = (grid.ravel() for grid in np.meshgrid(*counts, indexing="ij"))
    part = np.arange(steps) * 3 // steps
    curvature = np.choose(part[None], [c[:, None] for c in (first, second, third)])
    yaw = np.cumsum(curvature * SPACING, axis=1)
    x = start + np.cumsum(SPACING * np.cos(yaw), axis=1)
    y = np.cumsum(SPACING * np.sin(yaw), axis=1)
    return np.column_stack([x.ravel(), y.ravel(), yaw.ravel()])


def measure_fan(rover: Rover, threads: int) -> list[Figure]:
    """Measure the fan on one thread, and on two where there are so many."""
    ground, fan = make_mars_terrain(1, 24.0, 0.05), enav_fan(-3.0)

    def score_on(count: int) -> None:
        numba.set_num_threads(count)
        score_poses(rover, ground, fan)

    one = median_time(lambda: score_on(1))
    figures = [
        Figure("fan", "poses", len(fan), "", repeats=1),
        Figure("fan", "1,694 paths on one thread, CPU time", one, "s", 0.35),
    ]
    if threads > 1:
        calls = [lambda: score_on(1), lambda: score_on(2)]
        one, two = median_times(calls, clock=time.perf_counter)
        against = "one thread by the same clock"
        figures += [
            Figure("fan", "1,694 paths on two threads, by the clock", two, "s"),
            Figure("fan", "how much faster two threads are", one / two, "x", 1.7, True, against),
        ]
    return figures


def measure_map(rover: Rover) -> list[Figure]:
    """Sweep a map at 8 headings, row by row, until there is enough."""
    ground = make_mars_terrain(2, MAP_CELLS * 0.05, 0.05)
    elevation = ground.elevation[:MAP_CELLS, :MAP_CELLS]
    ground = Terrain(elevation, ground.resolution, ground.origin)
    rates, before = [], peak_memory(resource.RUSAGE_SELF)
    began = time.perf_counter()
    for first, scores in sweep_map(rover, ground):
        taken = time.perf_counter() - began
        if MAP_ROWS[0] <= first < MAP_ROWS[1]:
            rates.append(scores.status.size / taken)
        if first >= MAP_ROWS[1]:
            break
        began = time.perf_counter()
    rate, cells = statistics.median(rates), ground.elevation.size
    memory = peak_memory(resource.RUSAGE_SELF) - before
    name = f"map of {MAP_CELLS:,} x {MAP_CELLS:,} cells"
    return [
        Figure("map", f"{name}: poses per second, all threads", rate, "1/s", repeats=len(rates)),
        Figure("map", f"{name}: 8 headings take", 8 * cells / rate, "s", repeats=len(rates)),
        Figure("map", f"{name}: memory for it", memory, "MB", repeats=1),
    ]
