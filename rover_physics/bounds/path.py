# SPDX-License-Identifier: Apache-2.0
"""Bounds on the prediction along a path over an uncertain map.

If a terrain has a layer `elevation_std`, each height may be wrong by a given number of standard
deviations. docs/uncertainty.md has the method, docs/validation.md its failure rate.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from rover_physics.bounds.forces import MAX_SOILS
from rover_physics.bounds.kernel import BOUNDS, NOMINAL, find_bounds
from rover_physics.errors import ModelError
from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.read_only import seal_array
from rover_physics.prediction.packed_model import forget_models, pack_model
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_bounds import PathBounds
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import Ground, new_ground

SIGMAS = 3.0
"""Default number of standard deviations by which the map's heights may be wrong."""
BOUNDED_VALUES = tuple(name for name in BOUNDS.names or () if name != "status")
"""Names of the bounded values in `PathPrediction` and `PathBounds`."""


def check_sigmas(sigmas: float | None) -> float:
    """Return the number of standard deviations as a float, 0 for None.

    Raises:
        ModelError: Not a number, or negative.
    """
    value = 0.0 if sigmas is None else float(sigmas)
    if not (np.isfinite(value) and value >= 0.0):
        raise ModelError(
            f"sigmas is {sigmas}; it must be a number of standard deviations, 0 to take the map "
            "as exact"
        )
    return value


def bound_path(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    options: SweepOptions = DEFAULT_OPTIONS,
    sigmas: float | None = SIGMAS,
) -> PathBounds | None:
    """Bound a prediction along a path over a map with uncertain heights.

    Args:
        rover: The rover.
        terrain: The ground, with its layer `elevation_std`.
        prediction: The result of `judge_path` on the same terrain.
        options: The options of that `judge_path`.
        sigmas: Number of standard deviations by which each height may be wrong; 0 or None for no
            bounds.

    Returns:
        Bounds on each waypoint, which contain the prediction; None if the terrain has no such
        layer or there are no standard deviations.

    Raises:
        ModelError: `sigmas` is negative or not a number, an option that this rover cannot have, a
            terrain with too many soils, or policy "servo".
        SoilError: As `judge_path`.
    """
    allowed = check_sigmas(sigmas)
    if terrain.elevation_std is None or allowed == 0.0:
        return None
    if options.policy == SERVO:
        raise ModelError(
            f"policy {SERVO!r} has no bounds on a map with uncertain heights; judge with 0 "
            f"sigmas, or use {EQUAL!r} or {OPTIMAL!r}"
        )
    if len(terrain.soil_names) >= MAX_SOILS:
        raise ModelError(
            f"the terrain has {len(terrain.soil_names)} soils; bounds are found on maps with at "
            f"most {MAX_SOILS - 1}"
        )
    grounds, model = _pack_uncertain(terrain, allowed), pack_model(rover, terrain, options)
    found = find_bounds(
        model,
        grounds,
        check_poses(prediction.poses),
        np.ascontiguousarray(prediction.motion),
        _pack_nominal(prediction),
    )
    values = {name: _include(found[name], prediction, name) for name in BOUNDED_VALUES}
    return PathBounds(sigmas=allowed, status=found.status.copy(), **values)


@lru_cache(maxsize=2)
def _pack_uncertain(terrain: Terrain, sigmas: float) -> tuple[Ground, Ground, Ground]:
    """Return the lowest and highest terrain within its errors, and the errors."""
    assert terrain.elevation_std is not None
    error = sigmas * terrain.elevation_std
    heights = (terrain.elevation - error, terrain.elevation + error, error)
    bare = replace(terrain, elevation_std=None)  # errors are not checked once more for each
    low, high, wrong = (new_ground(replace(bare, elevation=seal_array(one))) for one in heights)
    return low, high, wrong


def prepare_bounds(terrain: Terrain, sigmas: float) -> None:
    """Pack an uncertain terrain for `bound_path`, so that the first bounds on it are fast."""
    if terrain.elevation_std is not None and sigmas > 0.0:
        _pack_uncertain(terrain, sigmas)


def forget_terrains() -> None:
    """Forget the terrains of earlier predictions and bounds, which may take much memory."""
    _pack_uncertain.cache_clear()
    forget_models()


def _pack_nominal(prediction: PathPrediction) -> Any:
    nominal = np.zeros(len(prediction.poses), NOMINAL)
    nominal["settled"] = prediction.settled
    nominal["q"] = np.column_stack(
        [
            prediction.position[:, 2],
            prediction.roll,
            prediction.pitch,
            prediction.rocker_angle[:, 0],
            prediction.bogie_angle,
        ]
    )
    nominal["contact_angle"] = prediction.contact_angle
    nominal["contact_points"] = prediction.contact_points
    return nominal


def _include(bounds: Floats, prediction: PathPrediction, name: str) -> Floats:
    """Return bounds widened to the predicted values; NaN where there are no bounds."""
    value = getattr(prediction, name)
    widened = np.array(bounds)
    widened[..., 0] = np.minimum(bounds[..., 0], value)
    widened[..., 1] = np.maximum(bounds[..., 1], value)
    return widened
