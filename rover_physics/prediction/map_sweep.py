"""Scores of many single poses, such as all cells of a map.

A prediction keeps about 100 numbers per pose, which is 6 GB for a map of a million cells at eight
headings. Here each pose keeps only the numbers that decide whether the rover can stand and drive
there.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.numerics.arrays import SingleFloats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.numerics.threads import limit_threads, run_chunks
from rover_physics.prediction.evaluation import (
    AHEAD,
    effort,
    evaluate_pose,
    new_works,
    set_pose,
)
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

BATCH = 32_768
"""Approximate number of poses of a map that are scored at a time."""
NUMBERS = 6
"""Numbers in a score, without the status."""


@dataclass(frozen=True, eq=False)
class PoseScores:
    """Scores of poses: read-only arrays of one shape, NaN where the rover does not settle."""

    status: NDArray[np.int8]
    """PoseStatus of each pose."""
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

    @quiet
    def within_limits(self, rover: Rover) -> NDArray[np.bool_]:
        """Return True where the rover keeps its limits, sinkage and suspension not checked."""
        limits = rover.limits
        return np.asarray(
            (self.status == PoseStatus.SETTLED)
            & (self.friction_utilisation <= limits.friction_utilisation)
            & (self.torque_saturation <= limits.torque_saturation)
            & (self.least_load >= 0.0)
            & (self.least_load < np.inf)
            & (self.tip_over_ratio >= limits.tip_over_ratio)
            & (self.tilt <= limits.tilt)
            & (self.belly_clearance >= limits.belly_clearance)
        )


def score_poses(
    rover: Rover, terrain: Terrain, poses: ArrayLike, options: SweepOptions = DEFAULT_OPTIONS
) -> PoseScores:
    """Score single poses; nothing between them is evaluated.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (..., 3) x, y [m] and yaw [rad] of base_link in the map frame.
        options: As for `sweep_path`.

    Returns:
        Scores with the shape of `poses` without its last axis.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError, SoilError: As `sweep_path`.
    """
    given = np.asarray(poses)
    flat = check_poses(given.reshape(-1, 3) if given.shape[-1:] == (3,) else given)
    return _score(pack_model(rover, terrain, options), flat, given.shape[:-1])


def sweep_map(
    rover: Rover, terrain: Terrain, headings: int = 8, options: SweepOptions = DEFAULT_OPTIONS
) -> Iterator[tuple[int, PoseScores]]:
    """Score the rover at each cell of a map and several headings, a few rows at a time.

    Args:
        rover: The rover.
        terrain: The map of (ny, nx) cells.
        headings: Number of headings, the first along x, then equally spaced to the left.
        options: As for `sweep_path`.

    Yields:
        Index of the first row, and scores (rows, nx, headings) of it and the rows that follow.
        A score takes 25 bytes per pose.

    Raises:
        ModelError, SoilError: As `sweep_path`.
    """
    ny, nx = terrain.elevation.shape
    x = terrain.origin[0] + terrain.resolution * np.arange(nx)
    yaw = np.arange(headings) * (2.0 * np.pi / headings)
    model = pack_model(rover, terrain, options)
    rows = max(1, BATCH // (nx * headings))
    for first in range(0, ny, rows):
        y = terrain.origin[1] + terrain.resolution * np.arange(first, min(first + rows, ny))
        grid = np.stack(np.broadcast_arrays(x[:, None], y[:, None, None], yaw), axis=-1)
        poses = np.ascontiguousarray(grid.reshape(-1, 3))
        yield first, _score(model, poses, grid.shape[:-1])


def _score(model: PackedModel, poses: np.ndarray, shape: tuple[int, ...]) -> PoseScores:
    """Score poses (n, 3) and return scores of `shape`, which has n elements."""
    n = len(poses)
    status, numbers = np.empty(n, np.int8), np.empty((NUMBERS, n), np.float32)
    with limit_threads(effort(model.settings, n)) as threads:
        works = new_works(threads, n)
        sweep = model.records, (poses, AHEAD), works, (status, numbers)
        run_chunks(score_all, sweep, len(works), threads)
    return PoseScores(status.reshape(shape), *(values.reshape(shape) for values in numbers))


@kernel
def score_all(models, places, works, scores, part):
    """Score the poses of some chunks, one chunk per work space.

    Args:
        models: (1,) MODEL.
        places: (n, 3) x, y [m] and yaw [rad] of the body origin, map frame, and their motions, as
            for `evaluate`.
        works: (chunks,) WORK.
        scores: (n,) PoseStatus, and (NUMBERS, n) numbers in the order of `PoseScores`, written.
        part: The first chunk and the one after the last.
    """
    (poses, motions), (status, numbers), chunks = places, scores, works.size
    n = poses.shape[0]
    for chunk in range(part[0], part[1]):
        for i in range(n * chunk // chunks, n * (chunk + 1) // chunks):
            set_pose(models[0], poses, motions, i, works[chunk])
            evaluate_pose(models[0], works[chunk], works[chunk].result)
            status[i] = works[chunk].result.status
            write_score(works[chunk].result, i, numbers)


@kernel
def write_score(result, i, numbers):
    """Write the score of a RESULT into column i of numbers (NUMBERS, n), as in `PoseScores`."""
    if result.status != PoseStatus.SETTLED:
        for k in range(NUMBERS):
            numbers[k, i] = np.nan
        return
    use, saturation, least = 0.0, 0.0, np.inf
    if not result.speed_share > 0.0:
        use = np.inf
    for wheel in range(6):
        use = max(use, result.friction_utilisation[wheel])
        saturation = max(saturation, result.torque_saturation[wheel])
        least = min(least, result.wheel_loads[wheel])
    upright = np.cos(result.q[1]) * np.cos(result.q[2])
    numbers[0, i], numbers[1, i], numbers[2, i] = use, saturation, least
    numbers[3, i] = result.tip_over_ratio
    numbers[4, i] = np.arccos(min(max(upright, -1.0), 1.0))
    numbers[5, i] = result.belly_clearance
