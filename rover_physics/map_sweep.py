"""Many poses that form no path, such as all cells of a map: few numbers each, in batches.

A prediction keeps some 100 numbers a pose; of a map of a million cells at eight headings that
would be 6 GB. Here one batch of results at a time is boiled down to what decides whether the rover
can stand and drive at a pose.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.evaluation import evaluate
from rover_physics.model_setup import Setup, set_up
from rover_physics.rover import Rover
from rover_physics.settling import SETTLED
from rover_physics.sweep import check_poses, one_sweep_at_a_time
from rover_physics.terrain import Terrain

BATCH = 32_768
"""Poses that are evaluated at a time; their results take 35 MB."""

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PoseScores:
    """What decides about poses; arrays of one shape, NaN where the rover does not settle."""

    status: NDArray[np.int8]
    """SETTLED, OFF_MAP, UNKNOWN_GROUND, NOT_SETTLED or NO_EQUILIBRIUM of `sweep`."""
    friction_utilisation: Floats
    """Largest of the six wheels; infinite where one lifts off."""
    torque_saturation: Floats
    """Largest of the six wheels."""
    least_load: Floats
    """Smallest of the six wheel loads [N]."""
    tip_over_ratio: Floats
    """Tip-over angle over that on flat ground."""
    tilt: Floats
    """Angle between body z and the vertical [rad]."""
    belly_clearance: Floats
    """Smallest height of the underside above the ground [m]."""

    def within_limits(self, rover: Rover) -> NDArray[np.bool_]:
        """Tell where the rover keeps the limits of its file, but for sinkage and suspension."""
        limits = rover.limits
        return np.asarray(
            (self.status == SETTLED)
            & (self.friction_utilisation <= limits.friction_utilisation)
            & (self.torque_saturation <= limits.torque_saturation)
            & (self.least_load >= 0.0)
            & (self.tip_over_ratio >= limits.tip_over_ratio)
            & (self.tilt <= limits.tilt)
            & (self.belly_clearance >= limits.belly_clearance)
        )


def score_poses(rover: Rover, terrain: Terrain, poses: ArrayLike, **arguments: Any) -> PoseScores:
    """Score poses each for itself, with nothing between them.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (..., 3) x, y [m] and yaw [rad] of base_link in the map frame, of any shape.
        arguments: Further arguments of `sweep_path`.

    Returns:
        Arrays of the shape of the poses without the last axis.

    Raises:
        PoseError: poses of wrong shape, or not finite.
        ModelError, SoilError: As `sweep_path`.
    """
    given = np.asarray(poses)
    flat = check_poses(given.reshape(-1, 3) if given.shape[-1:] == (3,) else given)
    setup = set_up(rover, terrain, **arguments)
    scores = _empty_scores(given.shape[:-1])
    for first in range(0, len(flat), BATCH):
        _score_batch(setup, flat[first : first + BATCH], scores, first)
    return scores


def sweep_map(
    rover: Rover, terrain: Terrain, headings: int = 8, **arguments: Any
) -> Iterator[tuple[int, PoseScores]]:
    """Score the rover over each cell of a map at headings all around, a few rows at a time.

    Args:
        rover: The rover.
        terrain: The map of (ny, nx) cells.
        headings: Number of headings, the first along x, then equally spaced to the left.
        arguments: Further arguments of `sweep_path`.

    Yields:
        The first row, and scores (rows, nx, headings) of that row and those that follow. Whoever
        keeps all of them keeps 25 bytes a pose.

    Raises:
        ModelError, SoilError: As `sweep_path`.
    """
    ny, nx = terrain.elevation.shape
    x = terrain.origin[0] + terrain.resolution * np.arange(nx)
    yaw = np.arange(headings) * (2.0 * np.pi / headings)
    setup = set_up(rover, terrain, **arguments)
    rows = max(1, BATCH // (nx * headings))
    for first in range(0, ny, rows):
        y = terrain.origin[1] + terrain.resolution * np.arange(first, min(first + rows, ny))
        grid = np.stack(np.broadcast_arrays(x[:, None], y[:, None, None], yaw), axis=-1)
        scores = _empty_scores(grid.shape[:-1])
        _score_batch(setup, np.ascontiguousarray(grid.reshape(-1, 3)), scores, 0)
        yield first, scores


def _empty_scores(shape: tuple[int, ...]) -> PoseScores:
    def blank() -> Floats:
        return np.full(shape, np.nan, np.float32)

    status = np.zeros(shape, np.int8)
    return PoseScores(status, blank(), blank(), blank(), blank(), blank(), blank())


def _score_batch(setup: Setup, poses: np.ndarray, scores: PoseScores, first: int) -> None:
    """Score poses (n, 3) into rows `first` and on of the scores, counted in all their axes."""
    with one_sweep_at_a_time:
        results = evaluate(*setup, poses)
    status = scores.status.reshape(-1)[first : first + len(poses)]
    status[:] = results["status"]
    settled = status == SETTLED
    q = results["q"]
    upright = np.clip(np.cos(q[:, 1]) * np.cos(q[:, 2]), -1.0, 1.0)
    found = {
        "friction_utilisation": results["friction_utilisation"].max(axis=1),
        "torque_saturation": results["torque_saturation"].max(axis=1),
        "least_load": results["wheel_loads"].min(axis=1),
        "tip_over_ratio": results["tip_over_ratio"],
        "tilt": np.arccos(upright),
        "belly_clearance": results["belly_clearance"],
    }
    for name, values in found.items():
        row = getattr(scores, name).reshape(-1)[first : first + len(poses)]
        row[settled] = values[settled]
