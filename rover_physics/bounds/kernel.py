"""Bounds on all that is predicted at one pose of uncertain ground, and the sweep of it."""

from typing import Any

import numpy as np
from numba import prange

from rover_physics.bounds.belly import bound_clearance
from rover_physics.bounds.contact import CONTACT_BOUNDS, bound_contacts
from rover_physics.bounds.forces import BOX, LOAD, PULL, TIP, USE, bound_forces
from rover_physics.bounds.pose import (
    BOUNDED,
    NOT_SETTLED,
    SINGULAR,
    SPREAD,
    bound_configuration,
)
from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.forces.soil import solve_wheel
from rover_physics.forces.stability import CORNERS
from rover_physics.forces.torques import EQUAL
from rover_physics.numerics.kernels import kernel, sweep_kernel
from rover_physics.numerics.records import new_record, record_type
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.evaluation import CHUNK, MAX_CHUNKS
from rover_physics.rover.linkage import place
from rover_physics.terrain.ground import copy_soil

BOUNDS_EFFORT = 50
"""Time to bound a pose, in that to predict it under equal torques."""

NOMINAL = record_type(
    ("settled", np.bool_),  # whether the pose was settled
    ("q", float, (6,)),  # configuration, as in `settling`
    ("contact_angle", float, (6,)),  # contact angles [rad]
    ("contact_points", float, (6, 3)),  # where the wheels touch [m]
)
"""What was predicted at a pose on the ground as the map has it."""

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
"""Smallest and largest values at one pose; all are as in `PathBounds`."""

BOUNDS_WORK = record_type(("spread", SPREAD), ("contact_bounds", CONTACT_BOUNDS), ("box", BOX))
"""Work space of one thread."""


def new_bounds(n: int) -> Any:
    """Return the bounds (n,) of n poses, all NaN."""
    blank = new_record(BOUNDS)
    for name in BOUNDS.names or ():
        blank[name] = 0 if name == "status" else np.nan
    return np.full(n, blank, BOUNDS).view(np.recarray)


def find_bounds(setup, low, high, error, poses, nominal) -> Any:
    """Bound what is predicted at poses (n, 3); return BOUNDS (n,).

    Args:
        setup: The `Setup` of the sweep.
        low: The lowest ground.
        high: The highest ground.
        error: A Ground whose elevation is how far both are from the ground in between [m].
        poses: (n, 3) x, y [m] and yaw [rad].
        nominal: (n,) NOMINAL, what was predicted on the ground in between.
    """
    bounds = new_bounds(len(poses))
    works = np.zeros(min(MAX_CHUNKS, -(-len(poses) // CHUNK)), BOUNDS_WORK)
    for name in ("held_height", "held_angle"):
        works["spread"]["model"]["contacts"][name] = np.nan
    records = (np.array([record]) for record in setup[1:])
    grounds = (ground.records for ground in (low, high, error))
    with limit_threads(BOUNDS_EFFORT * len(poses)):
        bound_poses(setup.ground.records, *grounds, *records, poses, nominal, works, bounds)
    return bounds


@sweep_kernel
def bound_poses(
    grounds, low, high, error, linkages, samplings, settings, poses, nominal, works, bounds
):
    """Bound the poses into `bounds` in chunks, as many as there are work spaces."""
    n, chunks = poses.shape[0], works.size
    for chunk in prange(chunks):
        for i in range(n * chunk // chunks, n * (chunk + 1) // chunks):
            bounds[i].status = bound_pose(
                grounds[0], low[0], high[0], error[0], linkages[0], samplings[0], settings[0],
                poses[i], nominal[i], works[chunk], bounds[i],
            )  # fmt: skip


@kernel
def bound_pose(ground, low, high, error, linkage, samples, settings, pose, nominal, work, result):
    """Bound one pose into `result`; return BOUNDED or what keeps it from being bounded."""
    spread, contact_bounds, box = work.spread, work.contact_bounds, work.box
    if not nominal.settled:
        return NOT_SETTLED
    for k in range(6):
        spread.q[k] = nominal.q[k]
    outcome = bound_configuration(ground, low, high, linkage, samples, pose, spread)
    if outcome != BOUNDED:
        return outcome
    placement = spread.model.placement
    place(linkage, pose[0], pose[1], pose[2], spread.q, placement)
    bound_contacts(
        ground, error, samples, placement, nominal.contact_angle, nominal.contact_points,
        spread.reach, contact_bounds,
    )  # fmt: skip
    bound_clearance(ground, error, linkage, spread, result.belly_clearance)
    if not bound_forces(ground, linkage, samples, settings, pose, spread, contact_bounds, box):
        return SINGULAR
    _write_configuration(spread, result)
    _write_tip_over(settings, box, result)
    for wheel in range(6):
        _write_wheel(ground, linkage, settings, wheel, box, result)
    if settings.policy != EQUAL:
        _let_torques_follow(settings, spread.model.search, result)
    return BOUNDED


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
        smallest = min(smallest, box.smallest[TIP + edge])
        largest = min(largest, box.largest[TIP + edge])
    result.tip_over_ratio[0] = smallest / settings.flat_angle
    result.tip_over_ratio[1] = largest / settings.flat_angle


@kernel
def _write_wheel(ground, linkage, settings, wheel, box, result):
    """Write the bounds on load, sinkage, torque saturation and utilisation of a wheel."""
    weight = linkage.mass * linkage.gravity
    lightest, heaviest = weight * box.smallest[LOAD + wheel], weight * box.largest[LOAD + wheel]
    backward, forward = weight * box.smallest[PULL + wheel], weight * box.largest[PULL + wheel]
    most = max(abs(backward), abs(forward))
    least = min(abs(backward), abs(forward)) if backward * forward > 0.0 else 0.0
    result.wheel_loads[wheel, 0], result.wheel_loads[wheel, 1] = lightest, heaviest
    resistance, shallowest, deepest, soil = 0.0, 0.0, 0.0, box.soil
    if settings.on_soil:
        least = 0.0
        shallowest = np.inf
        for k in range(box.soil_count[wheel]):
            copy_soil(ground, box.soils[wheel, k], soil)
            light = solve_wheel(soil, 1.0, linkage.radius, linkage.width, lightest, 0.0, 0.0)
            heavy = solve_wheel(soil, 1.0, linkage.radius, linkage.width, heaviest, 0.0, 0.0)
            shallowest, deepest = min(shallowest, light[1]), max(deepest, heavy[1])
            resistance = max(resistance, heavy[2])
    result.sinkage[wheel, 0], result.sinkage[wheel, 1] = shallowest, deepest
    result.torque_saturation[wheel, 0] = linkage.radius * least / settings.max_torque
    result.torque_saturation[wheel, 1] = linkage.radius * (most + resistance) / settings.max_torque
    result.friction_utilisation[wheel, 0] = 0.0
    if heaviest > 0.0:
        result.friction_utilisation[wheel, 0] = least / (box.mu_high[wheel] * heaviest)
    result.friction_utilisation[wheel, 1] = box.largest[USE + wheel] if lightest > 0.0 else np.inf


@kernel
def _let_torques_follow(settings, search, result):
    """Widen the bounds of one set of torques to those of the sets that are best at each ground.

    These need no more friction than the worst wheel of the one set, within the limit of the torque
    where the one set keeps it, and they keep the wheels on the ground where it does.
    """
    allowed = settings.allowed_torque / settings.max_torque
    most_use, most_torque, least_load = 0.0, allowed, 0.0
    for wheel in range(6):
        most_use = max(most_use, result.friction_utilisation[wheel, 1])
        most_torque = max(most_torque, result.torque_saturation[wheel, 1])
        least_load = min(least_load, result.wheel_loads[wheel, 0])
    if settings.on_soil:
        # There a torque beyond its limit counts like a friction utilisation beyond 1.
        most_use = max(most_use, most_torque / allowed if most_torque > allowed else 0.0)
        most_torque = max(most_torque, most_use * allowed)
    for k in range(FREE_TORQUES, FREE_FORCES):
        if search.y[k] != 0.0:
            # Lateral forces are passed on only where equal shares of them would slip.
            most_use = max(most_use, 1.0)
    for wheel in range(6):
        result.friction_utilisation[wheel, 0] = result.torque_saturation[wheel, 0] = 0.0
        result.friction_utilisation[wheel, 1] = most_use
        result.torque_saturation[wheel, 1] = most_torque
        result.wheel_loads[wheel, 0] = least_load
        result.wheel_loads[wheel, 1] = np.inf
