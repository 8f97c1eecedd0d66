# SPDX-License-Identifier: Apache-2.0
"""Bounds on the prediction at a pose on uncertain ground, and their parallel sweep over poses."""

from typing import Any

import numpy as np

from rover_physics.bounds.belly import bound_clearance
from rover_physics.bounds.contact import CONTACT_BOUNDS, bound_contacts
from rover_physics.bounds.forces import (
    BOX,
    LOAD_OUTPUTS,
    PULL_OUTPUTS,
    TIP_OUTPUTS,
    USE_OUTPUTS,
    bound_forces,
)
from rover_physics.bounds.pose import SPREAD, bound_configuration
from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.forces.soil import SoilWheel, solve_wheel
from rover_physics.forces.stability import CORNERS
from rover_physics.numerics.interruption import slices
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.read_only import view_read_only
from rover_physics.numerics.records import new_record, record_type
from rover_physics.numerics.threads import limit_threads, run_chunks
from rover_physics.prediction.evaluation import CHUNK, MAX_CHUNKS, MODEL, WORK, set_pose
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.rover.linkage import place
from rover_physics.status import BoundStatus, TorquePolicy
from rover_physics.terrain.ground import GROUND, Ground, copy_soil

BOUNDS_EFFORT = 50
"""Time to bound a pose over the time to predict it with equal torques."""

NOMINAL = record_type(
    ("settled", np.bool_),  # whether the pose was settled
    ("q", float, (6,)),  # configuration, as in `settling`
    ("contact_angle", float, (6,)),  # contact angles [rad]
    ("contact_points", float, (6, 3)),  # contact points [m], map frame
)
"""Prediction at a pose on the nominal ground, without errors."""

BOUNDS = record_type(
    ("status", np.int8),
    ("roll", float, (2,)),
    ("pitch", float, (2,)),
    ("rocker_angle", float, (2, 2)),
    ("bogie_angle", float, (2, 2)),
    ("belly_clearance", float, (2,)),
    ("tip_over_ratio", float, (2,)),
    ("wheel_loads", float, (6, 2)),
    ("friction_utilisation", float, (6, 2)),
    ("torque_saturation", float, (6, 2)),
    ("sinkage", float, (6, 2)),
)
"""Smallest and largest values at one pose, with quantities and units as in `PathBounds`."""

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


def new_bounds(n: int) -> Any:
    """Return BOUNDS (n,), all NaN with status 0."""
    blank = new_record(BOUNDS)
    for name in BOUNDS.names or ():
        blank[name] = 0 if name == "status" else np.nan
    return np.full(n, blank, BOUNDS).view(np.recarray)


def find_bounds(
    model: PackedModel,
    grounds: tuple[Ground, Ground, Ground],
    poses: np.ndarray,
    motions: np.ndarray,
    nominal: np.ndarray,
) -> Any:
    """Bound the prediction at poses; return BOUNDS (n,).

    Args:
        model: The model on the nominal ground.
        grounds: The lowest and the highest ground, and one whose elevation is the largest error of
            each height [m].
        poses: (n, 3) x, y [m] and yaw [rad] of the body origin, map frame.
        motions: (n, 3) their motions, as for `evaluate`; the wheels are steered along them.
        nominal: (n,) NOMINAL, the prediction on the nominal ground.
    """
    bounds = new_bounds(len(poses))
    works = np.zeros(min(MAX_CHUNKS, -(-len(poses) // CHUNK)), BOUNDS_WORK)
    for name in ("held_height", "held_angle"):
        works["rover"]["contacts"][name] = np.nan
    uncertain = _pack_uncertain(model, *grounds)
    with limit_threads(BOUNDS_EFFORT * len(poses)) as threads:
        for part in slices(len(poses)):
            places = (view_read_only(one[part]) for one in (poses, motions, nominal))
            sweep = uncertain, tuple(places), works, bounds[part]
            run_chunks(bound_poses, sweep, len(works), threads)
    return bounds


def _pack_uncertain(model: PackedModel, low: Ground, high: Ground, error: Ground) -> Any:
    """Return the UNCERTAIN (1,) of a model; it is valid as long as the grounds live."""
    uncertain = np.zeros(1, UNCERTAIN)
    uncertain["nominal"] = uncertain["low"] = uncertain["high"] = model.record
    uncertain["low"]["ground"], uncertain["high"]["ground"] = low.records, high.records
    uncertain["error"] = error.records
    return uncertain


@kernel
def bound_poses(uncertains, places, works, bounds, part):
    """Bound the poses of some chunks, one chunk per work space.

    Args:
        uncertains: (1,) UNCERTAIN.
        places: `poses`, `motions` and `nominal` of `find_bounds`.
        works: (chunks,) BOUNDS_WORK.
        bounds: (n,) BOUNDS, written.
        part: The first chunk and the one after the last.
    """
    (poses, motions, nominal), chunks = places, works.size
    n = poses.shape[0]
    for chunk in range(part[0], part[1]):
        for i in range(n * chunk // chunks, n * (chunk + 1) // chunks):
            set_pose(uncertains[0].nominal, poses, motions, i, works[chunk].rover)
            bounds[i].status = bound_pose(uncertains[0], nominal[i], works[chunk], bounds[i])


@kernel
def bound_pose(uncertain, nominal, work, result):
    """Bound the pose of `work` into `result`, a BOUNDS; return its BoundStatus."""
    model, spread, box = uncertain.nominal, work.spread, work.box
    if not nominal.settled:
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
    for wheel in range(6):
        _write_wheel(model, wheel, box, result)
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
def _write_wheel(model, wheel, box, result):
    """Write the bounds on load, sinkage, torque saturation and utilisation of a wheel."""
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
            light = solve_wheel(soil, own, lightest, 0.0, 0.0)
            heavy = solve_wheel(soil, own, heaviest, 0.0, 0.0)
            shallowest = min(shallowest, light.sinkage)
            deepest = max(deepest, heavy.sinkage)
            resistance = max(resistance, heavy.resistance)
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
            # Lateral forces differ from equal shares only if equal shares would slip.
            most_use = max(most_use, 1.0)
    for wheel in range(6):
        result.friction_utilisation[wheel, 0] = result.torque_saturation[wheel, 0] = 0.0
        result.friction_utilisation[wheel, 1] = most_use
        result.torque_saturation[wheel, 1] = most_torque
        result.wheel_loads[wheel, 0] = least_load
        result.wheel_loads[wheel, 1] = np.inf
