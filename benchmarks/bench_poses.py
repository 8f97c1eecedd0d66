# SPDX-License-Identifier: Apache-2.0
"""Times single poses on one core, and a map of a million cells."""

import resource
import statistics
import time
from functools import partial

import numba

from benchmarks.grounds import all_grounds, made_square, random_poses
from benchmarks.measure import Figure, median_times, peak_memory
from rover_physics import Rover, SweepOptions, load_rover, score_poses, sweep_map

POSES = 4_000
"""Poses on each ground."""
MAP_CELLS = 1_000
"""Cells along each side of the map."""
MAP_ROWS = (100, 180)
"""First and last row of the part that is timed; the map is uniform except at its edges."""


def measure() -> list[Figure]:
    """Measure poses and the map."""
    threads, rover = numba.config.NUMBA_NUM_THREADS, load_rover("lsr1")
    numba.set_num_threads(1)
    figures = measure_poses(rover)
    numba.set_num_threads(threads)
    return figures + measure_map(rover)


def measure_poses(rover: Rover) -> list[Figure]:
    """Measure a pose anywhere on each ground under both policies."""
    figures = []
    for name, ground in all_grounds().items():
        poses = random_poses(ground, POSES)
        calls = [
            partial(score_poses, rover, ground, poses, SweepOptions(policy=policy))
            for policy in ("equal", "optimal")
        ]
        equal, optimal = (1e6 * taken / POSES for taken in median_times(calls))
        figures += [
            Figure("pose", f"{name}: full, equal torques", equal, "us", 8.0),
            Figure("pose", f"{name}: what optimal torques add", optimal - equal, "us", 100.0),
        ]
    return figures


def measure_map(rover: Rover) -> list[Figure]:
    """Sweep a map at 8 headings, row by row, until there is enough."""
    ground, rates, before = made_square(2, MAP_CELLS), [], peak_memory(resource.RUSAGE_SELF)
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
