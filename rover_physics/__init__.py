# SPDX-License-Identifier: Apache-2.0
"""Quasi-static model of a rocker-bogie rover on uneven ground: NumPy in, dataclasses out.

The names below are the API. Each is imported on first use, so a program that only reads a rover
file does not load the compiled model.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rover_physics.deprecated import sweep_path as sweep_path
    from rover_physics.deprecated import sweep_paths as sweep_paths
    from rover_physics.deprecated import sweep_poses as sweep_poses
    from rover_physics.errors import RoverError as RoverError
    from rover_physics.prediction.map_sweep import PoseScores as PoseScores
    from rover_physics.prediction.map_sweep import score_poses as score_poses
    from rover_physics.prediction.map_sweep import sweep_map as sweep_map
    from rover_physics.prediction.sweep_options import SweepOptions as SweepOptions
    from rover_physics.results.path_prediction import PathPrediction as PathPrediction
    from rover_physics.rover.model import Rover as Rover
    from rover_physics.rover.rover_file import load_rover as load_rover
    from rover_physics.status import PoseStatus as PoseStatus
    from rover_physics.terrain.grid import Terrain as Terrain
    from rover_physics.terrain.grid import load_terrain as load_terrain
    from rover_physics.terrain.grid import save_terrain as save_terrain
    from rover_physics.traversability.classification import classify_path as classify_path
    from rover_physics.traversability.judge import judge_path as judge_path
    from rover_physics.traversability.judge import judge_paths as judge_paths
    from rover_physics.traversability.judge import judge_poses as judge_poses
    from rover_physics.traversability.pieces import judge_pieces as judge_pieces
    from rover_physics.traversability.reach import judge_reach as judge_reach
    from rover_physics.traversability.torque_ranges import find_torque_ranges as find_torque_ranges
    from rover_physics.traversability.verdict import Verdict as Verdict

__version__ = "0.1.0"

_HOMES = {
    "PathPrediction": "results.path_prediction",
    "PoseScores": "prediction.map_sweep",
    "PoseStatus": "status",
    "Rover": "rover.model",
    "RoverError": "errors",
    "SweepOptions": "prediction.sweep_options",
    "Terrain": "terrain.grid",
    "Verdict": "traversability.verdict",
    "classify_path": "traversability.classification",
    "find_torque_ranges": "traversability.torque_ranges",
    "judge_path": "traversability.judge",
    "judge_paths": "traversability.judge",
    "judge_pieces": "traversability.pieces",
    "judge_poses": "traversability.judge",
    "judge_reach": "traversability.reach",
    "load_rover": "rover.rover_file",
    "load_terrain": "terrain.grid",
    "save_terrain": "terrain.grid",
    "score_poses": "prediction.map_sweep",
    "sweep_map": "prediction.map_sweep",
    "sweep_path": "deprecated",
    "sweep_paths": "deprecated",
    "sweep_poses": "deprecated",
}
"""Names of the API, and the module below this package that holds each."""

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Import a name of the API when it is first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
