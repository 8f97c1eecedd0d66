"""Measures how run time grows with path length, candidates, map size and wheel samples."""

import numba
import numpy as np

from benchmarks.measure import Figure, median_time
from rover_physics.prediction.evaluation import evaluate
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import sweep_path
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import PathQueryOptions, answer_path_query
from rover_planner.worlds.mars_terrain import make_mars_terrain

LENGTHS = (2.5, 5.0, 10.0, 20.0)
"""Of paths [m]."""
CANDIDATES = (1, 3, 9)
"""Largest numbers of candidates of a question."""
MAP_SIZES = (240, 480, 960)
"""Cells along each side of a map."""
RESOLUTIONS = (0.05, 0.02, 0.01)
"""Cell sizes [m]."""


def straight(length: float) -> np.ndarray:
    """Return poses (n, 3), 2 cm apart on a straight line through the middle of a map."""
    x = np.arange(-0.5 * length, 0.5 * length, 0.02)
    return np.column_stack([x, 0.0 * x, 0.0 * x])


def measure() -> list[Figure]:
    """Measure the growth. Ratios compare times per pose, so 1 means linear growth."""
    numba.set_num_threads(1)
    rover = load_rover("lsr1")
    ground = make_mars_terrain(1, 24.0, 0.05)
    per_pose = {}
    for length in LENGTHS:
        poses = straight(length)
        taken = median_time(lambda: sweep_path(rover, ground, poses))  # noqa: B023
        per_pose[length] = taken / len(poses) * 1e6
    figures = [
        Figure("growth", f"path of {length:g} m, with what lies between", value, "us/pose")
        for length, value in per_pose.items()
    ]
    return figures + _candidates(rover, ground) + _maps(rover) + _samples(rover)


def _candidates(rover, ground: Terrain) -> list[Figure]:
    figures = []
    for count in CANDIDATES:
        options = PathQueryOptions(count=count)
        taken = median_time(
            lambda: answer_path_query(rover, ground, (-5, 0, 0), (5, 0, 0), options)  # noqa: B023
        )
        figures.append(Figure("growth", f"10 m query, {count} candidates", taken * 1e3, "ms"))
    return figures


def _maps(rover) -> list[Figure]:
    """The same poses on the same ground, cut out of maps of different size."""
    whole = make_mars_terrain(3, MAP_SIZES[-1] * 0.05, 0.05)
    poses, times = straight(8.0), []
    for cells in MAP_SIZES:
        first = (whole.elevation.shape[0] - cells) // 2
        corner = whole.origin[0] + first * whole.resolution
        part = whole.elevation[first : first + cells, first : first + cells]
        model = pack_model(rover, Terrain(part, whole.resolution, (corner, corner)))
        times.append(median_time(lambda: evaluate(model.records, poses), 21))  # noqa: B023
    return [
        Figure("growth", f"map of {cells} x {cells} cells", value / len(poses) * 1e6, "us/pose")
        for cells, value in zip(MAP_SIZES, times, strict=True)
    ]


def _samples(rover) -> list[Figure]:
    """Measure the same ground with finer cells; a wheel is sampled at the map's resolution."""
    figures = []
    for resolution in RESOLUTIONS:
        model = pack_model(rover, make_mars_terrain(1, 10.0, resolution))
        poses = straight(6.0)
        taken = median_time(lambda: evaluate(model.records, poses), 11) / len(poses) * 1e6  # noqa: B023
        count = int(model.record.samples.rows * model.record.samples.circles)
        figures.append(Figure("growth", f"{count} samples a wheel", taken, "us/pose"))
    return figures
