"""Whole sets of poses: JPL's ENav fan of 1,694 paths, and a map of a million cells."""

import resource
import time

import numba
import numpy as np
from measure import Figure, median_time

from rover_physics.evaluation import evaluate
from rover_physics.model_setup import set_up
from rover_physics.rover import load_rover
from rover_planner.mars_terrain import make_mars_terrain

ARCS = (14, 11, 11)
"""ENav's tree: so many curvatures on the first, second and third part of a path."""
REACH = 6.0
"""Length of a path [m]."""
SPACING = 0.25
"""Distance of the poses along a path [m]."""
TURN = 0.35
"""Largest curvature [1/m]."""
BATCH = 50_000


def enav_fan(start: float) -> np.ndarray:
    """Return poses (40656, 3) of 14 x 11 x 11 paths of three arcs, 24 each, from x = start [m]."""
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
    setup = set_up(rover, make_mars_terrain(1, 24.0, 0.05))
    fan = enav_fan(-3.0)
    figures = [Figure("fan", "poses", len(fan), "")]
    clock = time.perf_counter
    numba.set_num_threads(1)
    one = median_time(lambda: evaluate(*setup, fan), clock=clock)
    figures.append(Figure("fan", "1,694 paths on one thread", one, "s", 0.35))
    if numba.config.NUMBA_NUM_THREADS > 1:
        numba.set_num_threads(2)
        two = median_time(lambda: evaluate(*setup, fan), clock=clock)
        figures.append(Figure("fan", "1,694 paths on two threads", two, "s"))
        figures.append(Figure("fan", "one thread / two threads", one / two, "x", 1.7, True))
    return figures + measure_map(rover)


def measure_map(rover) -> list[Figure]:
    """Evaluate a map of 1,000 x 1,000 cells at 8 headings in batches, a sample of it timed."""
    ground = make_mars_terrain(2, 50.0, 0.05)
    setup = set_up(rover, ground)
    ny, nx = ground.elevation.shape
    rows = np.linspace(20, ny - 21, 12).astype(int)
    x = ground.origin[0] + ground.resolution * np.arange(nx)
    poses = np.array(
        [
            (x[j], ground.origin[1] + ground.resolution * i, heading)
            for i in rows
            for heading in np.arange(8) * np.pi / 4
            for j in range(20, nx - 20)
        ]
    )
    start = time.perf_counter()
    for first in range(0, len(poses), BATCH):
        evaluate(*setup, poses[first : first + BATCH])
    taken = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rate = len(poses) / taken
    return [
        Figure("map", f"poses per second, map of {ny} x {nx} cells", rate, "1/s"),
        Figure("map", "the whole map at 8 headings", 8 * ny * nx / rate, "s"),
        Figure("map", "peak memory of the process", peak, "MB"),
    ]
