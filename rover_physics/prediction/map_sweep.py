# SPDX-License-Identifier: Apache-2.0
"""Scores of many single poses, such as all cells of a map.

A prediction keeps about 100 numbers per pose, which is 6 GB for a map of a million cells at eight
headings. Here each pose keeps only the uses of the limits, and the numbers that maps show.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.errors import ModelError
from rover_physics.numerics.arrays import Floats, SingleFloats, freeze_fields
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.uses import RoverLimits, find_uses
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

BATCH = 32_768
"""Approximate number of poses of a map that are scored at a time."""
PART = 4096
"""Number of poses whose results are in memory at a time."""


@dataclass(frozen=True, eq=False)
class PoseScores:
    """Scores of poses: read-only arrays of one shape, NaN where the rover does not settle."""

    limits: RoverLimits
    """The limits that were asked."""
    status: NDArray[np.int8]
    """PoseStatus of each pose."""
    uses: SingleFloats
    """Use of each limit, in a further last axis; infinite where the rover does not settle."""
    friction_utilisation: SingleFloats
    """Largest of the six wheels; infinite where a wheel lifts off, and with speed servos where no
    forward speed balances."""
    torque_saturation: SingleFloats
    """Largest of the six wheels."""
    least_load: SingleFloats
    """Smallest of the six wheel loads [N]."""
    tip_over_ratio: SingleFloats
    """Tip-over angle over that on flat ground."""
    tilt: SingleFloats
    """Angle between body z and the vertical [rad]."""
    belly_clearance: SingleFloats
    """Smallest height of the underside above the ground [m]."""

    def __post_init__(self) -> None:
        freeze_fields(self)

    @property
    def passable(self) -> NDArray[np.bool_]:
        """True where the rover settles and keeps all its limits."""
        return ~np.asarray((self.uses > 1.0).any(axis=-1))


SCORES = tuple(one.name for one in fields(PoseScores))[3:]
"""Names of the numbers in a score, besides limits, status and uses."""


def score_poses(
    rover: Rover, terrain: Terrain, poses: ArrayLike, options: SweepOptions = DEFAULT_OPTIONS
) -> PoseScores:
    """Score single poses; nothing between them is evaluated.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (..., 3) x, y [m] and yaw [rad] of base_link in the map frame.
        options: As for `judge_path`.

    Returns:
        Scores with the shape of `poses` without its last axis.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError, SoilError: As `judge_path`.
    """
    given = np.asarray(poses)
    flat = check_poses(given.reshape(-1, 3) if given.shape[-1:] == (3,) else given)
    return score(pack_model(rover, terrain, options), flat, given.shape[:-1])


def sweep_map(
    rover: Rover, terrain: Terrain, headings: int = 8, options: SweepOptions = DEFAULT_OPTIONS
) -> Iterator[tuple[int, PoseScores]]:
    """Score the rover at each cell of a map and several headings, a few rows at a time.

    Args:
        rover: The rover.
        terrain: The map of (ny, nx) cells.
        headings: Number of headings, at least 1; the first is along x, the others are equally
            spaced to the left.
        options: As for `judge_path`.

    Yields:
        Index of the first row, and scores (rows, nx, headings) of it and the rows that follow.
        A score takes 25 bytes per pose, and 4 for each limit.

    Raises:
        ModelError: No heading, or as `judge_path`.
        SoilError: As `judge_path`.
    """
    if headings < 1:
        raise ModelError(f"headings is {headings}; it must be a number of headings, at least 1")
    ny, nx = terrain.elevation.shape
    x = terrain.origin[0] + terrain.resolution * np.arange(nx)
    yaw = np.arange(headings) * (2.0 * np.pi / headings)
    model = pack_model(rover, terrain, options)
    rows = max(1, BATCH // (nx * headings))
    for first in range(0, ny, rows):
        y = terrain.origin[1] + terrain.resolution * np.arange(first, min(first + rows, ny))
        grid = np.stack(np.broadcast_arrays(x[:, None], y[:, None, None], yaw), axis=-1)
        poses = np.ascontiguousarray(grid.reshape(-1, 3))
        yield first, score(model, poses, grid.shape[:-1])


@quiet
def score(model: PackedModel, poses: np.ndarray, shape: tuple[int, ...]) -> PoseScores:
    """Score poses (n, 3) and return scores of `shape`, which has n elements."""
    n, limits = len(poses), model.limits
    status, numbers = np.empty(n, np.int8), np.empty((len(SCORES), n), np.float32)
    uses = np.empty((n, len(limits)), np.float32)
    with limit_threads(model.relative_cost(n)):
        for first in range(0, n, PART):
            part = slice(first, first + PART)
            results = model.evaluate(poses[part])
            status[part], numbers[:, part] = results["status"], find_scores(results)
            uses[part] = find_uses(limits, results).use
    values = (row.reshape(shape) for row in numbers)
    return PoseScores(limits, status.reshape(shape), uses.reshape(*shape, -1), *values)


def find_scores(results: Any) -> Floats:
    """Return the numbers (k, n) of RESULTs (n,), in the order of SCORES."""
    settled = results["status"] == PoseStatus.SETTLED
    use = results["friction_utilisation"].max(axis=1)
    use[~(results["speed_share"] > 0.0)] = np.inf
    saturation = results["torque_saturation"].max(axis=1)
    least = results["wheel_loads"].min(axis=1)
    single = (results[name] for name in ("tip_over_ratio", "tilt", "belly_clearance"))
    return np.where(settled, np.stack([use, saturation, least, *single]), np.nan)
