"""Uncertain maps: bounds on what is predicted, and the verdict that follows from them.

Where a terrain has a layer `elevation_std`, each height may be anywhere within so many standard
deviations. docs/uncertainty.md has the method, what it assumes and how often it fails.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds_forces import MOST_SOILS
from rover_physics.bounds_kernel import NOMINAL, find_bounds
from rover_physics.bounds_pose import (
    BOUNDED,
    OFF_MAP_NEAR,
    ON_EDGE,
    SINGULAR,
    UNKNOWN_NEAR,
)
from rover_physics.errors import ModelError
from rover_physics.ground import Ground, pack_ground
from rover_physics.limits import Verdict, find_reasons
from rover_physics.model_setup import set_up
from rover_physics.prediction import Floats, PathPrediction
from rover_physics.rover import Rover
from rover_physics.sweep import one_sweep_at_a_time
from rover_physics.terrain import Terrain

SIGMAS = 3.0
"""Standard deviations of the map that are allowed for unless told."""
BOUNDED_VALUES = (
    "roll",
    "pitch",
    "rocker_angle",
    "bogie_angle",
    "belly_clearance",
    "tip_over_ratio",
    "wheel_loads",
    "friction_utilisation",
    "torque_saturation",
    "sinkage",
)
"""What is bounded, by its names in `PathPrediction` and `PathBounds`."""
_UNBOUNDED = {
    ON_EDGE: ("not_settled", "a wheel may climb or fall off an edge"),
    UNKNOWN_NEAR: ("unknown_ground", "a wheel may reach unknown ground"),
    OFF_MAP_NEAR: ("off_map", "a wheel may leave the map"),
    SINGULAR: ("no_equilibrium", "the wheel loads may not be determined"),
}


@dataclass(frozen=True, eq=False)
class PathBounds:
    """Bounds along a path of n waypoints: smallest and largest value in the last axis.

    The values and their units are those of `PathPrediction`. NaN where a waypoint has no bounds.
    """

    sigmas: float
    """Standard deviations of the map that are allowed for."""
    status: NDArray[np.int8]
    """(n,) BOUNDED, or of `bounds_pose` why not."""
    roll: Floats
    """(n, 2) [rad]."""
    pitch: Floats
    """(n, 2) [rad]."""
    rocker_angle: Floats
    """(n, 2, 2) [rad]."""
    bogie_angle: Floats
    """(n, 2, 2) [rad]."""
    belly_clearance: Floats
    """(n, 2) [m]."""
    tip_over_ratio: Floats
    """(n, 2)."""
    wheel_loads: Floats
    """(n, 6, 2) [N]; largest infinite where the torques follow the ground (policy "optimal")."""
    friction_utilisation: Floats
    """(n, 6, 2)."""
    torque_saturation: Floats
    """(n, 6, 2)."""
    sinkage: Floats
    """(n, 6, 2) [m]."""

    @property
    def bounded(self) -> NDArray[np.bool_]:
        """(n,) True for the waypoints that have bounds."""
        return np.asarray(self.status == BOUNDED)

    @property
    def tilt(self) -> Floats:
        """(n, 2) smallest and largest angle between the body's z axis and the vertical [rad]."""
        roll, pitch = _sizes(self.roll), _sizes(self.pitch)
        return np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))


def _sizes(angles: Floats) -> Floats:
    """Return the smallest and largest absolute value (n, 2) within intervals (n, 2)."""
    sizes = np.sort(np.abs(angles), axis=1)
    sizes[angles[:, 0] * angles[:, 1] < 0.0, 0] = 0.0
    return sizes


def check_sigmas(sigmas: float | None) -> float:
    """Return the standard deviations to allow for, 0 for none.

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
    sigmas: float | None = SIGMAS,
    **arguments: Any,
) -> PathBounds | None:
    """Bound what was predicted along a path where the heights of the map are uncertain.

    Args:
        rover: The rover.
        terrain: The ground, with its layer `elevation_std`.
        prediction: Of `sweep_path` over the same terrain.
        sigmas: Standard deviations by which each height may be wrong; 0 or None for no bounds.
        arguments: The further arguments that `sweep_path` had.

    Returns:
        Bounds on each waypoint that contain the prediction; None where there is nothing to
        bound: a terrain without the layer, or no standard deviations to allow for.

    Raises:
        ModelError: `sigmas` is negative or no number, or an argument that makes no sense.
        SoilError: As `sweep_path`.
    """
    allowed = check_sigmas(sigmas)
    if terrain.elevation_std is None or allowed == 0.0:
        return None
    if len(terrain.soil_names) >= MOST_SOILS:
        raise ModelError(
            f"the terrain has {len(terrain.soil_names)} soils; bounds are found on maps with at "
            f"most {MOST_SOILS - 1}"
        )
    low, high, error = _spread(terrain, allowed)
    setup = set_up(rover, terrain, **arguments)
    with one_sweep_at_a_time:
        found = find_bounds(setup, low, high, error, prediction.poses, _pack_nominal(prediction))
    values = {name: _include(found[name], prediction, name) for name in BOUNDED_VALUES}
    return PathBounds(sigmas=allowed, status=found.status.copy(), **values)


@lru_cache(maxsize=2)
def _spread(terrain: Terrain, sigmas: float) -> tuple[Ground, Ground, Ground]:
    """Return the lowest and the highest ground, and how far they are from the one in between."""
    assert terrain.elevation_std is not None
    error = np.ascontiguousarray(sigmas * terrain.elevation_std)
    low, high, between = (
        pack_ground(replace(terrain, elevation=elevation))
        for elevation in (terrain.elevation - error, terrain.elevation + error, error)
    )
    return low, high, between


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
    """Return bounds widened to the predicted values; NaN where there are none."""
    value = getattr(prediction, name)
    widened = np.array(bounds)
    widened[..., 0] = np.minimum(bounds[..., 0], value)
    widened[..., 1] = np.maximum(bounds[..., 1], value)
    return widened


def judge_bounds(
    rover: Rover, prediction: PathPrediction, bounds: PathBounds, verdict: Verdict
) -> Verdict:
    """Add to a verdict what the bounds refuse; nothing that it refuses is taken back.

    Args:
        rover: The rover, with its limits.
        prediction: The prediction that was bounded.
        bounds: Its bounds.
        verdict: The verdict on the prediction itself.

    Returns:
        The verdict with the further refusals and with the extremes of the bounds. The reason of a
        waypoint that the prediction passes says that it holds at worst.
    """
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    within = f"within {bounds.sigmas:g} sigma of the map"
    for i, (code, reason) in enumerate(zip(*_find_worst(rover, prediction, bounds), strict=True)):
        if not codes[i] and code:
            codes[i], reasons[i] = code, f"{reason}, at worst {within}"
    for i, status in enumerate(bounds.status.tolist()):
        if not codes[i] and status in _UNBOUNDED:
            codes[i], what = _UNBOUNDED[status]
            reasons[i] = f"{what} {within}"
    first: int = next((k for k, code in enumerate(codes) if code), -1)
    falls = np.asarray(prediction.falling.any(axis=1))
    needed = bounds.bounded & ~falls
    return replace(
        verdict,
        traversable=first < 0,
        reasons=tuple(reasons),
        codes=tuple(codes),
        first_failure=first,
        code=codes[first] if first >= 0 else "",
        reason=reasons[first] if first >= 0 else "",
        map_sigmas=bounds.sigmas,
        tip_over_ratio_bound=_extreme(np.min, bounds.tip_over_ratio[bounds.bounded, 0]),
        friction_utilisation_bound=_extreme(np.max, bounds.friction_utilisation[needed, :, 1]),
        torque_saturation_bound=_extreme(np.max, bounds.torque_saturation[needed, :, 1]),
        tilt_bound=_extreme(np.max, bounds.tilt[bounds.bounded, 1]),
        belly_clearance_bound=_extreme(np.min, bounds.belly_clearance[bounds.bounded, 0]),
    )


def _extreme(choose, values: Floats) -> float:
    known = values[~np.isnan(values)]
    return float(choose(known)) if known.size else float("nan")


def _find_worst(
    rover: Rover, prediction: PathPrediction, bounds: PathBounds
) -> tuple[list[str], list[str]]:
    """Return code and reason of the limits that are broken at worst, empty where none is."""

    def at(name: str, end: int) -> Floats:
        values = getattr(bounds, name)[..., end]
        return np.where(np.isnan(values), getattr(prediction, name), values)

    worst = replace(
        prediction,
        roll=_largest(prediction.roll, bounds.roll),
        pitch=_largest(prediction.pitch, bounds.pitch),
        rocker_angle=at("rocker_angle", 0),
        bogie_angle=at("bogie_angle", 0),
        belly_clearance=at("belly_clearance", 0),
        tip_over_ratio=at("tip_over_ratio", 0),
        wheel_loads=at("wheel_loads", 0),
        friction_utilisation=at("friction_utilisation", 1),
        torque_saturation=at("torque_saturation", 1),
        sinkage=at("sinkage", 1),
    )
    other = replace(worst, rocker_angle=at("rocker_angle", 1), bogie_angle=at("bogie_angle", 1))
    codes, reasons = find_reasons(rover, other)
    for i, (code, reason) in enumerate(zip(*find_reasons(rover, worst), strict=True)):
        if code and codes[i] != "suspension":
            codes[i], reasons[i] = code, reason
    return codes, reasons


def _largest(value: Floats, bounds: Floats) -> Floats:
    """Return of intervals (n, 2) the end farther from zero, the value (n,) where there is none."""
    rows = np.arange(len(bounds))
    farther = bounds[rows, np.argmax(np.abs(bounds), axis=1)]
    return np.where(np.isnan(farther), value, farther)
