"""Times poses where the rover cannot stand: along walls, and queries across a wall."""

import numpy as np

from benchmarks.measure import Figure, median_time
from rover_physics.prediction.evaluation import evaluate
from rover_physics.prediction.packed_model import pack_model
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import PathQueryOptions, answer_path_query

POSES = 300
"""Random poses near each wall."""
HEIGHTS = (0.3, 0.5, 1.0)
"""Heights of the walls [m]."""
"""Of the walls [m]."""


def wall(height: float, resolution: float, half: float) -> Terrain:
    """Return level ground with a winding step up along y at x = 0; all arguments in [m]."""
    axis = np.arange(-half, half + resolution, resolution)
    x, y = np.meshgrid(axis, axis)
    return Terrain(
        np.where(x + 0.2 * np.sin(3.0 * y) > 0.0, height, 0.0), resolution, (-half, -half)
    )


def measure() -> list[Figure]:
    """Measure poses near walls of several heights, then queries across a wall."""
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(-1.0, 1.0, (POSES, 2)), rng.uniform(-3.1, 3.1, POSES)])
    figures = []
    for name in ("lsr1", "m2020"):
        for height in HEIGHTS:
            model = pack_model(load_rover(name), wall(height, 0.02, 3.5))
            taken = median_time(lambda: evaluate(model.records, poses)) / POSES  # noqa: B023
            lost = (evaluate(model.records, poses)["status"] == PoseStatus.NOT_SETTLED).mean()
            label = f"{name}, wall of {height:g} m"
            figures += [
                Figure("wall", f"{label}: a pose within 1 m", 1e3 * taken, "ms"),
                Figure("wall", f"{label}: not settled", 100.0 * lost, "%", repeats=1),
            ]
    return figures + _measure_questions()


def _measure_questions() -> list[Figure]:
    rover, ground = load_rover("lsr1"), wall(0.5, 0.05, 6.0)
    figures = []
    for count in (1, 9):
        options = PathQueryOptions(count=count)
        taken = median_time(
            lambda: answer_path_query(rover, ground, (-5, 0, 0), (5, 0, 0), options)  # noqa: B023
        )
        name = f"10 m across a wall of 0.5 m, {count} candidates"
        figures.append(Figure("wall", name, 1e3 * taken, "ms"))
    return figures
