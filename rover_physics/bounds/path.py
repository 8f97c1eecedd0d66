# SPDX-License-Identifier: Apache-2.0
"""Bounds on the prediction along a path over an uncertain map.

If a terrain has a layer `elevation_std`, each height may be wrong by a given number of standard
deviations. docs/uncertainty.md has the method, docs/validation.md its failure rate.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from rover_physics.bounds.belly import bound_clearance
from rover_physics.bounds.contact import CONTACT_BOUNDS, bound_contacts
from rover_physics.bounds.forces import (
    BOX,
    LOAD_OUTPUTS,
    MAX_SOILS,
    PULL_OUTPUTS,
    TIP_OUTPUTS,
    USE_OUTPUTS,
    bound_forces,
)
from rover_physics.bounds.pose import SPREAD, bound_configuration
from rover_physics.errors import ModelError
from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.forces.soil import SoilWheel, solve_wheel
from rover_physics.forces.stability import CORNERS
from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_physics.numerics.arrays import seal_array, view_read_only
from rover_physics.numerics.interruption import slices
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.numerics.threads import limit_threads, run_chunks
from rover_physics.prediction.evaluation import CHUNK, MAX_CHUNKS, MODEL, WORK, set_pose
from rover_physics.prediction.packed_model import PackedModel, forget_models
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import (
    BOUNDED_VALUES,
    WAYPOINT_BOUNDS,
    PathBounds,
    PathPrediction,
)
from rover_physics.rover.linkage import place
from rover_physics.status import BoundStatus, PoseStatus, TorquePolicy
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import GROUND, Ground, copy_soil, new_ground

BOUNDS_EFFORT = 50
"""Time to bound a pose over the time to predict it with equal torques."""

UNCERTAIN = record_type(
    ("nominal", MODEL),  # the model on the nominal ground
    ("low", MODEL),  # the model on the lowest ground
    ("high", MODEL),  # the model on the highest ground
    ("error", GROUND),  # its elevation is the largest error of each height [m]
)
"""A model whose ground is known within bounds."""

BOUNDS_WORK = record_type(
    ("rover", WORK),  # work space of the model
    ("spread", SPREAD),  # bounds on the configuration
    ("contact_bounds", CONTACT_BOUNDS),  # bounds on the contacts
    ("box", BOX),  # bounds on the forces
)
"""Work space of one thread."""


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


def is_uncertain(terrain: Terrain, sigmas: float | None) -> bool:
    """Return whether heights of a terrain may be wrong by a number of standard deviations."""
    return bool(sigmas) and terrain.elevation_std is not None


def check_bounds(terrain: Terrain, options: SweepOptions) -> None:
    """Check that there are bounds on a terrain with uncertain heights.

    Raises:
        ModelError: A terrain with too many soils, or policy "servo".
    """
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


def bound_path(model: PackedModel, prediction: PathPrediction, sigmas: float) -> PathBounds | None:
    """Bound a prediction along a path over a map with uncertain heights.

    Args:
        model: The model on its terrain, with a layer `elevation_std`.
        prediction: What the model predicts.
        sigmas: Number of standard deviations by which each height may be wrong; 0 for no bounds.

    Returns:
        Bounds on each waypoint, which contain the prediction; None if the terrain has no such
        layer or there are no standard deviations.

    Raises:
        ModelError: As `check_bounds`.
    """
    terrain = model.terrain
    if not is_uncertain(terrain, sigmas):
        return None
    check_bounds(terrain, model.options)
    grounds = _pack_grounds(terrain, sigmas)
    found = find_bounds(model, grounds, prediction.poses, prediction.results)
    for name in BOUNDED_VALUES:
        value, (low, high) = getattr(prediction, name), np.moveaxis(found[name], -1, 0)
        low[:], high[:] = np.minimum(low, value), np.maximum(high, value)
    return PathBounds(sigmas, found)


@lru_cache(maxsize=2)
def _pack_grounds(terrain: Terrain, sigmas: float) -> tuple[Ground, Ground, Ground]:
    """Return the lowest and highest terrain within its errors, and the errors."""
    assert terrain.elevation_std is not None
    error = sigmas * terrain.elevation_std
    heights = (terrain.elevation - error, terrain.elevation + error, error)
    bare = replace(terrain, elevation_std=None)  # errors are not checked once more for each
    low, high, wrong = (new_ground(replace(bare, elevation=seal_array(one))) for one in heights)
    return low, high, wrong


def prepare_bounds(terrain: Terrain, sigmas: float) -> None:
    """Pack an uncertain terrain for `bound_path`, so that the first bounds on it are fast."""
    if is_uncertain(terrain, sigmas):
        _pack_grounds(terrain, sigmas)


def forget_terrains() -> None:
    """Forget the terrains of earlier predictions and bounds, which may take much memory."""
    _pack_grounds.cache_clear()
    forget_models()


def find_bounds(
    model: PackedModel, grounds: tuple[Ground, Ground, Ground], poses: np.ndarray, results: Any
) -> Any:
    """Bound the prediction at poses; return WAYPOINT_BOUNDS (n,).

    Args:
        model: The model on the nominal ground.
        grounds: The lowest and the highest ground, and one whose elevation is the largest error of
            each height [m].
        poses: (n, 3) x, y [m] and yaw [rad] of the body origin, map frame.
        results: (n,) RESULTs on the nominal ground; the wheels are steered along their motions.
    """
    bounds = np.zeros(len(poses), WAYPOINT_BOUNDS).view(np.recarray)
    for name in BOUNDED_VALUES:
        bounds[name] = np.nan
    works = np.zeros(min(MAX_CHUNKS, -(-len(poses) // CHUNK)), BOUNDS_WORK)
    for name in ("held_height", "held_angle"):
        works["rover"]["contacts"][name] = np.nan
    uncertain = np.zeros(1, UNCERTAIN)
    uncertain["nominal"] = uncertain["low"] = uncertain["high"] = model.record
    uncertain["low"]["ground"], uncertain["high"]["ground"], uncertain["error"] = (
        ground.records for ground in grounds
    )
    given = check_poses(poses), np.ascontiguousarray(results["motion"]), results
    with limit_threads(BOUNDS_EFFORT * len(poses)) as threads:
        for part in slices(len(poses)):
            places = (view_read_only(one[part]) for one in given)
            run_chunks(bound_poses, (uncertain, *places, works, bounds[part]), len(works), threads)
    return bounds


@kernel
def bound_poses(uncertains, poses, motions, results, works, bounds, first_chunk, end_chunk):
    """Bound the poses of some chunks, one chunk per work space.

    Args:
        uncertains: (1,) UNCERTAIN.
        poses: (n, 3) x, y [m] and yaw [rad] of the body origin.
        motions: (n, 3) their motions.
        results: (n,) RESULTs on the nominal ground.
        works: (chunks,) BOUNDS_WORK.
        bounds: (n,) WAYPOINT_BOUNDS, written.
        first_chunk: The first chunk.
        end_chunk: The one after the last.
    """
    n, chunks = poses.shape[0], works.size
    for chunk in range(first_chunk, end_chunk):
        for i in range(n * chunk // chunks, n * (chunk + 1) // chunks):
            set_pose(uncertains[0].nominal, poses, motions, i, works[chunk].rover)
            bounds[i].status = bound_pose(uncertains[0], results[i], works[chunk], bounds[i])


@kernel
def bound_pose(uncertain, nominal, work, result):
    """Bound the pose of `work` with a RESULT; write WAYPOINT_BOUNDS, return a BoundStatus."""
    model, spread, box = uncertain.nominal, work.spread, work.box
    if nominal.status != PoseStatus.SETTLED:
        return BoundStatus.NOT_SETTLED
    for k in range(6):
        spread.q[k] = nominal.q[k]
    outcome = bound_configuration(uncertain, work)
    if outcome != BoundStatus.BOUNDED:
        return outcome
    place(model.linkage, work.rover.pose, spread.q, work.rover.placement)
    bound_contacts(uncertain, work, nominal)
    bound_clearance(uncertain, work, result.belly_clearance)
    if not bound_forces(model, work):
        return BoundStatus.SINGULAR
    _write_configuration(spread, result)
    _write_tip_over(model.settings, box, result)
    moved = _load_moved(model.linkage, nominal, box)
    for wheel in range(6):
        _write_wheel(model, wheel, moved, box, result)
    if model.settings.policy != TorquePolicy.EQUAL:
        _let_torques_follow(model.settings, work.rover.search, result)
    return BoundStatus.BOUNDED


@kernel
def _write_configuration(spread, result):
    for side in range(2):
        low, high = spread.q_low, spread.q_high
        ends = low if side == 0 else high
        opposite = high if side == 0 else low
        result.roll[side], result.pitch[side] = ends[1], ends[2]
        result.rocker_angle[0, side] = ends[3]
        result.rocker_angle[1, side] = -opposite[3]
        result.bogie_angle[0, side], result.bogie_angle[1, side] = ends[4], ends[5]


@kernel
def _write_tip_over(settings, box, result):
    smallest, largest = np.inf, np.inf
    for edge in range(CORNERS):
        smallest = min(smallest, box.smallest[TIP_OUTPUTS + edge])
        largest = min(largest, box.largest[TIP_OUTPUTS + edge])
    result.tip_over_ratio[0] = smallest / settings.flat_angle
    result.tip_over_ratio[1] = largest / settings.flat_angle


@kernel
def _load_moved(linkage, nominal, box):
    """Return the largest load [N] that the policy's torques move from those of the box."""
    weight, moved = linkage.mass * linkage.gravity, 0.0
    for wheel in range(6):
        load = weight * box.base_value[LOAD_OUTPUTS + wheel]
        moved = max(moved, abs(nominal.wheel_loads[wheel] - load))
    return moved


@kernel
def _write_wheel(model, wheel, moved, box, result):
    """Write the bounds on load, sinkage, torque saturation and utilisation of a wheel.

    `moved` is `_load_moved`: the best torques on soil move loads on any map about as far.
    """
    ground, linkage, settings = model.ground, model.linkage, model.settings
    weight = linkage.mass * linkage.gravity
    lightest = weight * box.smallest[LOAD_OUTPUTS + wheel]
    heaviest = weight * box.largest[LOAD_OUTPUTS + wheel]
    backward = weight * box.smallest[PULL_OUTPUTS + wheel]
    forward = weight * box.largest[PULL_OUTPUTS + wheel]
    most = max(abs(backward), abs(forward))
    least = min(abs(backward), abs(forward)) if backward * forward > 0.0 else 0.0
    result.wheel_loads[wheel, 0], result.wheel_loads[wheel, 1] = lightest, heaviest
    resistance, shallowest, deepest, soil = 0.0, 0.0, 0.0, box.soil
    if settings.on_soil:
        least = 0.0
        shallowest = np.inf
        for k in range(box.soil_count[wheel]):
            copy_soil(ground, box.soils[wheel, k], soil)
            own = SoilWheel(linkage.radius, linkage.width, 1.0)
            light = solve_wheel(soil, own, lightest - moved, 0.0, 0.0)
            heavy = solve_wheel(soil, own, heaviest + moved, 0.0, 0.0)
            shallowest = min(shallowest, light.sinkage)
            deepest = max(deepest, heavy.sinkage)
            by_equal = solve_wheel(soil, own, heaviest, 0.0, 0.0)
            resistance = max(resistance, by_equal.resistance)
    result.sinkage[wheel, 0], result.sinkage[wheel, 1] = shallowest, deepest
    result.torque_saturation[wheel, 0] = linkage.radius * least / settings.max_torque
    result.torque_saturation[wheel, 1] = linkage.radius * (most + resistance) / settings.max_torque
    result.friction_utilisation[wheel, 0] = 0.0
    if heaviest > 0.0:
        result.friction_utilisation[wheel, 0] = least / (box.mu_high[wheel] * heaviest)
    largest = box.largest[USE_OUTPUTS + wheel]
    result.friction_utilisation[wheel, 1] = largest if lightest > 0.0 else np.inf


@kernel
def _let_torques_follow(settings, search, result):
    """Widen the bounds of one set of torques to those of the best torques on each possible ground.

    The best torques need no more friction than the worst wheel of this set. They keep the torque
    limit if this set does, and keep the wheels on the ground if this set does.
    """
    allowed = settings.allowed_torque / settings.max_torque
    most_use, most_torque, least_load = 0.0, allowed, 0.0
    for wheel in range(6):
        most_use = max(most_use, result.friction_utilisation[wheel, 1])
        most_torque = max(most_torque, result.torque_saturation[wheel, 1])
        least_load = min(least_load, result.wheel_loads[wheel, 0])
    if settings.on_soil:
        # On soil, a torque above its limit counts like a friction utilisation above 1.
        most_use = max(most_use, most_torque / allowed if most_torque > allowed else 0.0)
        most_torque = max(most_torque, most_use * allowed)
    for k in range(FREE_TORQUES, FREE_FORCES):
        if search.y[k] != 0.0:
            # Lateral forces differ from equal shares only if these need more than is allowed.
            most_use = max(most_use, settings.allowed_friction)
    for wheel in range(6):
        result.friction_utilisation[wheel, 0] = result.torque_saturation[wheel, 0] = 0.0
        result.friction_utilisation[wheel, 1] = most_use
        result.torque_saturation[wheel, 1] = most_torque
        result.wheel_loads[wheel, 0] = least_load
        result.wheel_loads[wheel, 1] = np.inf
