"""A query per waypoint: the torques of each wheel with which all constraints can be kept.

The forces that balance the rover and keep the paper's three constraints are a convex set. How low
and how high the torque of a wheel is in it is found by following the central path of the set's
self-concordant barrier from its analytic centre.

Source: Boyd and Vandenberghe, Convex Optimization, Cambridge 2004, section 11.3.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.prediction.evaluation import evaluate_pose, new_results, new_work
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_prediction import Floats
from rover_physics.prediction.sweep import check_poses, sweep_lock
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

PRECISION = 1e-5
"""Precision of the ranges, in largest torques."""
BARRIERS = 24.0
"""Parameter of the barrier: two for each of six cones and twelve limits."""
NEWTON_STEPS = 100
EQUAL_SHARES = 1e-9
"""Lateral forces, in weights, by which shares still count as equal."""


@dataclass(frozen=True, eq=False)
class TorqueRanges:
    """For each of n waypoints and wheel the torques that a set within all constraints can have."""

    feasible: np.ndarray
    """(n,) True where some torques keep all constraints."""
    lowest: Floats
    """(n, 6) lowest torque of each wheel [N m], NaN where not feasible."""
    highest: Floats
    """(n, 6) highest torque of each wheel [N m], NaN where not feasible."""

    def __post_init__(self) -> None:
        freeze_fields(self)


@dataclass(frozen=True, eq=False)
class _FeasibleSet:
    """Forces linear in x within cones and limits: a row per wheel, a constant and its slopes."""

    load: np.ndarray
    """(6, 1 + k) utmost shear: u nu N."""
    along: np.ndarray
    """(6, 1 + k) shear along the wheel: T + u R."""
    across: np.ndarray
    """(6, 1 + k) shear across the wheel: S."""
    thrust: np.ndarray
    """(6, 1 + k) torque over the wheel radius: T + R."""
    most: float
    """Largest torque over the wheel radius."""


def find_torque_ranges(
    rover: Rover, terrain: Terrain, poses: ArrayLike, options: SweepOptions = DEFAULT_OPTIONS
) -> TorqueRanges:
    """Find for each wheel the torques that keep all constraints, whatever the others then do.

    The constraints are sqrt(T^2 + S^2) <= mu N, N >= 0 and |torque| <= largest torque, the first
    and last within the rover's safety limits. Each wheel's range is with the other wheels' torques
    free; not all torques within the ranges go together. Lateral forces are as in policy "optimal":
    equal shares where these do, else free. On yielding soil, shear strength and resistance grow in
    proportion to the load from what they are at the torques of that policy.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        options: As for `sweep_path`; its policy is not looked at.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An argument that makes no sense.
        SoilError: A soil that is not among the presets.
    """
    poses = check_poses(poses)
    model = pack_model(rover, terrain, replace(options, policy="optimal"))
    n = len(poses)
    results, work = new_results(n), new_work()
    feasible = np.zeros(n, dtype=bool)
    lowest, highest = np.full((n, 6), np.nan), np.full((n, 6), np.nan)
    for i in range(n):
        with sweep_lock:
            work.pose[:] = poses[i]
            evaluate_pose(model.record, work, results[i])
        if results[i].status != PoseStatus.SETTLED or not _is_within(rover, model, results[i]):
            continue
        feasible[i] = True
        forces, start = _describe_set(rover, model, work.balance, results[i])
        lowest[i], highest[i] = _find_extremes(forces, start)
    scale = model.record.linkage.radius * model.record.linkage.mass * model.record.linkage.gravity
    return TorqueRanges(feasible, scale * lowest, scale * highest)


def _is_within(rover: Rover, model: PackedModel, result: Any) -> bool:
    friction = result.friction_utilisation.max() < rover.limits.friction_utilisation
    torque = np.abs(result.torque).max() < model.settings.allowed_torque
    return bool(friction and torque and result.wheel_loads.min() > 0.0)


def _describe_set(
    rover: Rover, model: PackedModel, balance: Any, result: Any
) -> tuple[_FeasibleSet, np.ndarray]:
    """Return the feasible set of a waypoint in units of the weight, and a point x (k,) in it."""
    weight = model.record.linkage.mass * model.record.linkage.gravity
    known = np.concatenate([result.tangential, result.lateral]) / weight
    slopes = np.vstack([balance.tangential, balance.lateral])
    start = np.linalg.lstsq(slopes[:, 1:], known - slopes[:, 0], rcond=None)[0]
    shared = np.abs(start[FREE_TORQUES:]).max() <= EQUAL_SHARES
    free = FREE_TORQUES if shared else FREE_FORCES
    normal, tangential, lateral = (
        rows[:, : 1 + free] for rows in (balance.normal, balance.tangential, balance.lateral)
    )
    used = rover.limits.friction_utilisation
    resistance = (result.motion_resistance / result.wheel_loads)[:, None] * normal
    strength = result.friction[:, None] * normal + resistance
    resistance = model.settings.direction * resistance
    forces = _FeasibleSet(
        load=used * strength,
        along=tangential + used * resistance,
        across=lateral.copy(),
        thrust=tangential + resistance,
        most=model.settings.allowed_torque / (model.record.linkage.radius * weight),
    )
    return forces, start[:free]


def _find_extremes(forces: _FeasibleSet, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centre = _go_to_centre(forces, start, np.zeros(len(start)))
    ends = np.empty((2, 6))
    for row, sign in enumerate((1.0, -1.0)):
        for wheel in range(6):
            x = _minimise(forces, centre, sign * forces.thrust[wheel, 1:])
            ends[row, wheel] = forces.thrust[wheel, 0] + forces.thrust[wheel, 1:] @ x
    return ends[0], ends[1]


def _minimise(forces: _FeasibleSet, x: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Return the x of the set at which cost @ x is least, to PRECISION."""
    sharpness = BARRIERS / forces.most
    while BARRIERS / sharpness > PRECISION * forces.most:
        sharpness *= 6.0
        x = _go_to_centre(forces, x, sharpness * cost)
    return x


def _go_to_centre(forces: _FeasibleSet, x: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Return the x that minimises cost @ x plus the barrier, by damped Newton steps."""
    for _ in range(NEWTON_STEPS):
        gradient, hessian = _differentiate_barrier(forces, x)
        gradient = gradient + cost
        step = np.linalg.lstsq(hessian, gradient, rcond=1e-14)[0]
        decrement = np.sqrt(max(gradient @ step, 0.0))
        if not decrement > 1e-4:
            break
        x = x - step / (1.0 + decrement if decrement > 0.25 else 1.0)
    return x


def _differentiate_barrier(forces: _FeasibleSet, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradient (k,) and Hessian (k, k) of the barrier at x."""
    rows = forces.load, forces.along, forces.across
    L, P, S = (row[:, 0] + row[:, 1:] @ x for row in rows)
    dL, dP, dS = (row[:, 1:] for row in rows)
    room = (L * L - P * P - S * S)[:, None]
    slope = 2.0 * (L[:, None] * dL - P[:, None] * dP - S[:, None] * dS) / room
    gradient = -slope.sum(axis=0)
    hessian = slope.T @ slope
    hessian -= 2.0 * ((dL / room).T @ dL - (dP / room).T @ dP - (dS / room).T @ dS)
    thrust = forces.thrust[:, 0] + forces.thrust[:, 1:] @ x
    turn = forces.thrust[:, 1:]
    above, below = 1.0 / (forces.most - thrust), 1.0 / (forces.most + thrust)
    gradient += turn.T @ (above - below)
    hessian += (turn.T * (above**2 + below**2)) @ turn
    return gradient, hessian
