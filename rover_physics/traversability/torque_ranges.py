# SPDX-License-Identifier: Apache-2.0
"""Torque ranges: the lowest and highest torque of each wheel that can keep all constraints.

The forces that balance the rover and keep the paper's three constraints form a convex set. The
lowest and the highest torque of a wheel in this set are second-order cone programs (SOCP), which
Clarabel solves.

Source: Goulart and Chen, Clarabel: An interior-point solver for conic programs with quadratic
objectives, arXiv:2405.12762, 2024.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.limits.table import WHEEL_CONSTRAINTS
from rover_physics.numerics.arrays import Floats, freeze_fields
from rover_physics.prediction.evaluation import NONE_HELD, evaluate_poses, new_works
from rover_physics.prediction.halving import NO_STRETCHES
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.record import new_results
from rover_physics.results.uses import find_uses
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

EQUAL_SHARES = 1e-9
"""Largest change of a lateral force [rover weights] at which the shares still count as equal."""


@dataclass(frozen=True, eq=False)
class TorqueRanges:
    """Torque range of each wheel at n waypoints, under all constraints; arrays are read-only."""

    feasible: np.ndarray
    """(n,) True where a set of torques keeps all constraints."""
    lowest: Floats
    """(n, 6) lowest torque of each wheel [N m], NaN where not feasible or not found."""
    highest: Floats
    """(n, 6) highest torque of each wheel [N m], NaN where not feasible or not found."""

    def __post_init__(self) -> None:
        freeze_fields(self)


def find_torque_ranges(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    curvature: ArrayLike | None = None,
) -> TorqueRanges:
    """Find the torque range of each wheel in which all constraints can be kept.

    The constraints are sqrt(T^2 + S^2) <= mu N, N >= 0 and |torque| <= largest torque; the first
    and the last include the rover's safety limits. The other wheels' torques are free in the range
    of a wheel, so not every combination of torques within the ranges is feasible. Lateral forces
    are as in policy "optimal": equal shares if these are feasible, else free. On yielding soil,
    shear strength and resistance are taken as proportional to the load, with the values at the
    torques of that policy as reference.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        options: As for `judge_path`; its policy and control margin are ignored.
        curvature: As for `judge_poses`, if the poses form no path.

    Returns:
        The range of each wheel [N m] at each pose; NaN where no torques keep all constraints.

    Raises:
        PoseError: Poses of wrong shape, or not finite; or such curvatures.
        ModelError: An option that this rover cannot have.
        SoilError: A soil that is not a preset.
    """
    poses = check_poses(poses)
    model = pack_model(rover, terrain, replace(options, policy="optimal", control_margin=0.0))
    n, motions = len(poses), motions_of(model, poses, curvature)
    feasible = np.zeros(n, dtype=bool)
    lowest, highest = np.full((n, 6), np.nan), np.full((n, 6), np.nan)
    for i, (results, work) in enumerate(evaluate_in_turn(model, poses, motions)):
        result = results[0]
        if result.status != PoseStatus.SETTLED or not _is_within(model, results):
            continue
        feasible[i] = True
        lowest[i], highest[i] = _find_extremes(*_describe_set(rover, model, work.balance, result))
    scale = model.record.linkage.radius * model.record.linkage.mass * model.record.linkage.gravity
    most = model.settings.allowed_torque  # Clarabel's tolerance is 1e-8
    lowest, highest = (np.clip(scale * ends, -most, most) for ends in (lowest, highest))
    return TorqueRanges(feasible, lowest, highest)


def evaluate_in_turn(
    model: PackedModel, poses: Floats, motions: Floats
) -> Iterator[tuple[Any, Any]]:
    """Yield RESULT (1,) and WORK of each pose and motion; the next pose overwrites both."""
    results, works = new_results(1), new_works(1, 1)
    for i in range(len(poses)):
        places = poses[i : i + 1], motions[i : i + 1], NONE_HELD
        # The kernel of sweeps, for one pose: a kernel of its own would compile the model again.
        sweep = model.records[None], model.limits.records, *places, NO_STRETCHES, works, results
        evaluate_poses(*sweep, 0, 1)
        yield results, works[0]


def _is_within(model: PackedModel, results: Any) -> bool:
    """Return whether a RESULT (1,) is within its limits of load, friction and torque."""
    uses = find_uses(model.limits, results)
    decisive = [row.code in WHEEL_CONSTRAINTS for row in uses.limits.rows]
    return not bool((uses.use[0, decisive] >= 1.0).any())  # NaN is not asked


def _describe_set(
    rover: Rover, model: PackedModel, balance: Any, result: Any
) -> tuple[Floats, Floats]:
    """Return the forces that keep the constraints, over the rover's weight, linear in x (k,).

    A row holds a constant and k slopes; its value is row @ [1, *x].

    Returns:
        (30, 1 + k) rows: three per wheel, a second-order cone of largest shear force, shear force
        along the wheel and across it; then the distance of each torque below its upper limit (6)
        and above its lower limit (6), over the wheel radius. And (6, 1 + k) the torques over the
        wheel radius, T + R.
    """
    weight = model.record.linkage.mass * model.record.linkage.gravity
    known = np.concatenate([result.tangential, result.lateral]) / weight
    slopes = np.vstack([balance.tangential, balance.lateral])
    used = np.linalg.lstsq(slopes[:, 1:], known - slopes[:, 0], rcond=None)[0]
    shared = np.abs(used[FREE_TORQUES:]).max() <= EQUAL_SHARES
    free = FREE_TORQUES if shared else FREE_FORCES
    normal, tangential, lateral = (
        rows[:, : 1 + free] for rows in (balance.normal, balance.tangential, balance.lateral)
    )
    most_used = rover.limits.friction_utilisation
    resistance = (result.motion_resistance / result.wheel_loads)[:, None] * normal
    strength = most_used * (result.friction[:, None] * normal + resistance)
    resistance = np.where(result.wheel_speed < 0.0, -1.0, 1.0)[:, None] * resistance
    cones = np.stack([strength, tangential + most_used * resistance, lateral], axis=1)
    thrust = tangential + resistance
    limits = np.vstack([-thrust, thrust])
    limits[:, 0] += model.settings.allowed_torque / (model.record.linkage.radius * weight)
    return np.vstack([*cones, limits]), thrust


def _find_extremes(rows: Floats, thrust: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and highest thrust (6,) of each wheel; NaN where the solver fails."""
    import clarabel  # imported here: it takes 0.25 s, with scipy.sparse
    from scipy.sparse import csc_matrix

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.equilibrate_enable = False  # scaled by the weight, all numbers are about 1
    cones = [clarabel.SecondOrderConeT(3)] * 6 + [clarabel.NonnegativeConeT(12)]
    k = thrust.shape[1] - 1
    solver = clarabel.DefaultSolver(
        csc_matrix((k, k)), np.zeros(k), csc_matrix(-rows[:, 1:]), rows[:, 0],
        cones, settings,
    )  # fmt: skip
    ends = np.full((2, 6), np.nan)
    for row, sign in enumerate((1.0, -1.0)):
        for wheel, (constant, *slopes) in enumerate(thrust):
            solver.update(q=sign * np.array(slopes))
            answer = solver.solve()
            if answer.status == clarabel.SolverStatus.Solved:
                ends[row, wheel] = constant + sign * answer.obj_val
    return ends[0], ends[1]
