"""Wheel forces where the ground may be soil: friction and resistance depend on the loads there."""

from rover_physics.forces.soil import SoilWheel, effective_friction, solve_wheel
from rover_physics.forces.torques import minimise_friction, take_equal_torques
from rover_physics.numerics.kernels import kernel
from rover_physics.status import TorquePolicy
from rover_physics.terrain.ground import copy_soil, soil_row_at

ROUNDS = 3
"""Searches for the best torques, each at the loads that the one before has found."""


@kernel
def share_forces_on_soil(model, work):
    """Find the wheel forces for the policy asked for; leave them in `work.search`.

    The search takes friction and resistance as they are under the loads of equal torques, then
    under the loads that it has found; the best of all these sets, equal torques included, is kept.
    """
    ground, linkage, settings = model.ground, model.linkage, model.settings
    search, best = work.search, work.best
    weight = linkage.mass * linkage.gravity
    for wheel in range(6):
        x, y = work.contacts.point[wheel, 0], work.contacts.point[wheel, 1]
        copy_soil(ground, soil_row_at(ground, x, y), work.soils[wheel])
    take_equal_torques(work.balance, search)
    if settings.policy == TorquePolicy.EQUAL:
        return
    least = _needed(linkage, settings, work)
    _copy(search, best)
    for _ in range(ROUNDS):
        _write_grip(linkage, settings, work)
        minimise_friction(
            work.balance, settings.allowed_torque / (linkage.radius * weight), search
        )
        needed = _needed(linkage, settings, work)
        if needed <= least:
            least = needed
            _copy(search, best)
    for wheel in range(6):
        search.wheel_loads[wheel], search.tangential[wheel] = best[0, wheel], best[1, wheel]
        search.lateral[wheel] = best[2, wheel]


@kernel
def _copy(search, best):
    for wheel in range(6):
        best[0, wheel], best[1, wheel] = search.wheel_loads[wheel], search.tangential[wheel]
        best[2, wheel] = search.lateral[wheel]


@kernel
def _write_grip(linkage, settings, work):
    """Write friction and resistance under the present loads into the search."""
    search = work.search
    weight = linkage.mass * linkage.gravity
    for wheel in range(6):
        soil = work.soils[wheel]
        N = weight * search.wheel_loads[wheel]
        own = SoilWheel(linkage.radius, linkage.width, search.mu[wheel])
        solved = solve_wheel(soil, own, N, 0.0, 0.0)
        search.mu[wheel] = effective_friction(soil, own, N)
        search.resistance[wheel] = settings.direction * solved.resistance / weight


@kernel
def _needed(linkage, settings, work):
    """Return the largest utilisation of the soil, or of the torque where that is beyond 1."""
    search = work.search
    weight = linkage.mass * linkage.gravity
    worst = 0.0
    for wheel in range(6):
        soil = work.soils[wheel]
        solved = solve_wheel(
            soil,
            SoilWheel(linkage.radius, linkage.width, search.mu[wheel]),
            weight * search.wheel_loads[wheel],
            settings.direction * weight * search.tangential[wheel],
            weight * search.lateral[wheel],
        )
        saturation = abs(solved.torque) / settings.allowed_torque
        worst = max(worst, solved.utilisation, saturation if saturation > 1.0 else 0.0)
    return worst
