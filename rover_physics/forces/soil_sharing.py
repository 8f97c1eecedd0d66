# SPDX-License-Identifier: Apache-2.0
"""Wheel forces on soil, where strength and resistance depend on the wheel loads."""

import numpy as np

from rover_physics.forces.soil import SOIL_FRICTION, SoilWheel, grip_on, solve_wheel
from rover_physics.forces.torques import LOAD_KEPT, apply_torques, minimise_friction
from rover_physics.numerics.kernels import kernel
from rover_physics.status import TorquePolicy
from rover_physics.terrain.ground import copy_soil, soil_row_at

ROUNDS = 3
"""Number of searches for the best torques; each uses the loads of the one before."""


@kernel
def share_forces_on_soil(model, work):
    """Find the wheel forces of the policy on soil and write them into `work.search`.

    Strength and resistance count as proportional to the load: in the first search as at the loads
    of equal torques, in the next ones as at the loads found. The best of these sets is kept; equal
    torques are one of them.

    Args:
        model: A record with `ground` GROUND, `linkage` LINKAGE and `settings` SETTINGS.
        work: WORK with contacts, rolling, balance and `search.mu`; `soils`, `best` and `search`
            are written.
    """
    ground, linkage, settings = model.ground, model.linkage, model.settings
    search, best = work.search, work.best
    for wheel in range(6):
        x, y = work.contacts.point[wheel, 0], work.contacts.point[wheel, 1]
        copy_soil(ground, soil_row_at(ground, x, y), work.soils[wheel])
        work.soils[wheel, SOIL_FRICTION] *= settings.friction_factor[wheel]
    apply_torques(work.balance, np.int64(0), search)
    if settings.policy == TorquePolicy.EQUAL:
        return
    least = _needed(linkage, settings, work)
    _copy(search, best)
    for _ in range(ROUNDS):
        _write_grip(linkage, work)
        minimise_friction(linkage, settings, work.balance, search)
        needed = _needed(linkage, settings, work)
        if needed <= least:
            least = needed
            _copy(search, best)
    for wheel in range(6):
        search.wheel_loads[wheel], search.tangential[wheel] = best[0, wheel], best[1, wheel]
        search.lateral[wheel] = best[2, wheel]


@kernel
def rolling_direction(work, wheel):
    """Return 1.0 if a wheel rolls forwards, -1.0 if backwards."""
    return -1.0 if work.rolling[wheel] < 0.0 else 1.0


@kernel
def _copy(search, best):
    for wheel in range(6):
        best[0, wheel], best[1, wheel] = search.wheel_loads[wheel], search.tangential[wheel]
        best[2, wheel] = search.lateral[wheel]


@kernel
def _write_grip(linkage, work):
    """Write strength and resistance over the load, at the current loads, into the search."""
    search = work.search
    weight = linkage.mass * linkage.gravity
    for wheel in range(6):
        N = weight * max(search.wheel_loads[wheel], LOAD_KEPT)
        own = SoilWheel(linkage.radius, linkage.width, search.mu[wheel])
        search.mu[wheel], resistance = grip_on(work.soils[wheel], own, N)
        search.resistance[wheel] = rolling_direction(work, wheel) * resistance


@kernel
def _needed(linkage, settings, work):
    """Return the largest utilisation of the soil or, if above 1, of the allowed torque."""
    search = work.search
    weight = linkage.mass * linkage.gravity
    worst = 0.0
    for wheel in range(6):
        soil = work.soils[wheel]
        solved = solve_wheel(
            soil,
            SoilWheel(linkage.radius, linkage.width, search.mu[wheel]),
            weight * search.wheel_loads[wheel],
            rolling_direction(work, wheel) * weight * search.tangential[wheel],
            weight * search.lateral[wheel],
        )
        saturation = abs(solved.torque) / settings.allowed_torque
        worst = max(worst, solved.utilisation, saturation if saturation > 1.0 else 0.0)
    return worst
