"""The torque set that needs least friction, in what equilibrium leaves free (policy optimal).

Three questions in turn, each asked only as far as the next one needs: which set keeps all wheels
on the ground, which of those keeps the torques within their limit, and which of those needs the
least friction, sqrt(T^2 + S^2) <= u mu N at the smallest u. Each is the least level of a family
of convex sets and is answered by the method of centres: go to the analytic centre of the set at
a level by damped Newton steps on its self-concordant barrier, then lower the level towards what
the centre needs.

Source: Boyd and El Ghaoui, "Method of centers for minimizing generalized eigenvalues", Linear
Algebra and its Applications 188, 1993.
"""

from enum import IntEnum

import numpy as np

from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_solve import solve_in_place
from rover_physics.numerics.records import record_type

MAX_LEVELS = 60
MAX_NEWTON_STEPS = 12
STAY = 0.25
"""Share of the old level kept above what the centre needs, so that the centre stays inside."""
LOAD_KEPT = 1e-4
"""Wheel load, in weights, that counts as on the ground."""
CENTRED = 0.1
"""Newton decrement at which a centre is near enough."""
LEVEL_PRECISION = 5e-5
"""Relative precision of the smallest level."""


class SearchGoal(IntEnum):
    """What a search lowers the level of."""

    LOAD = 0
    """The largest -N: the wheels are to stay on the ground."""
    TORQUE = 1
    """The largest torque."""
    FRICTION = 2
    """The largest friction utilisation."""


class SearchOutcome(IntEnum):
    """What a search for the best torques came to."""

    FOUND = 0
    """Torques within their limit that keep all wheels on the ground."""
    LIFTS = 1
    """No torques keep all wheels on the ground."""
    SATURATES = 2
    """None of those that do are within the limit."""


TORQUE_SEARCH = record_type(
    ("y", float, (FREE_FORCES,)),  # the free degrees, in the order of the columns of BALANCE
    ("wheel_loads", float, (6,)),  # N at y
    ("tangential", float, (6,)),  # T at y
    ("lateral", float, (6,)),  # S at y
    ("mu", float, (6,)),  # friction coefficients
    ("max_traction", float),  # largest torque over wheel radius; infinite: no limit
    ("resistance", float, (6,)),  # motion resistances, against the forward way, beside T
    ("H", float, (FREE_FORCES, FREE_FORCES)),  # Hessian of the barrier
    ("g", float, (FREE_FORCES, 1)),  # gradient of the barrier, then the Newton step
    ("gradient", float, (FREE_FORCES,)),  # gradient, kept
)
"""Work space of the search, in units of the rover's weight."""


@kernel
def apply_torques(balance, free, search):
    """Write the wheel forces at the first `free` degrees of y into the search."""
    y = search.y
    for i in range(6):
        N, T, S = balance.normal[i, 0], balance.tangential[i, 0], balance.lateral[i, 0]
        for k in range(free):
            N += balance.normal[i, 1 + k] * y[k]
            T += balance.tangential[i, 1 + k] * y[k]
            S += balance.lateral[i, 1 + k] * y[k]
        search.wheel_loads[i], search.tangential[i], search.lateral[i] = N, T, S


@kernel
def take_equal_torques(balance, search):
    """Write the wheel forces of equal torques into the search."""
    for wheel in range(6):
        search.wheel_loads[wheel] = balance.normal[wheel, 0]
        search.tangential[wheel] = balance.tangential[wheel, 0]
        search.lateral[wheel] = balance.lateral[wheel, 0]


@kernel
def minimise_friction(balance, max_traction, search):
    """Find the torques that need least friction, starting from equal ones; leave them in `search`.

    `max_traction` is the largest torque over wheel radius and weight; torque also overcomes the
    motion resistances in `search`. Lateral forces keep their equal shares where that does; where
    it does not, friction passes them on to wheels that still hold. Returns a SearchOutcome; where
    it is not FOUND, the set that comes nearest is left.
    """
    outcome = _search(balance, np.int64(FREE_TORQUES), max_traction, search)
    if outcome != SearchOutcome.FOUND or _needed(search, SearchGoal.FRICTION) > 1.0:
        outcome = _search(balance, np.int64(FREE_FORCES), max_traction, search)
    return outcome


@kernel
def _search(balance, free, max_traction, search):
    search.y[:] = 0.0
    apply_torques(balance, free, search)
    search.max_traction = np.inf
    if _needed(search, SearchGoal.LOAD) > -LOAD_KEPT:
        _lower(balance, free, SearchGoal.LOAD, -LOAD_KEPT, search)
        if _needed(search, SearchGoal.LOAD) > -LOAD_KEPT:
            return SearchOutcome.LIFTS
    if _needed(search, SearchGoal.TORQUE) >= max_traction:
        _lower(balance, free, SearchGoal.TORQUE, 0.999 * max_traction, search)
        if _needed(search, SearchGoal.TORQUE) >= max_traction:
            return SearchOutcome.SATURATES
    search.max_traction = max_traction
    _lower(balance, free, SearchGoal.FRICTION, 1e-6, search)
    return SearchOutcome.FOUND


@kernel
def _needed(search, goal):
    """Return the level that the present forces need."""
    worst = -np.inf
    for i in range(6):
        if goal == SearchGoal.LOAD:
            level = -search.wheel_loads[i]
        elif goal == SearchGoal.TORQUE:
            level = abs(search.tangential[i] + search.resistance[i])
        else:
            T, S = search.tangential[i], search.lateral[i]
            level = np.sqrt(T * T + S * S) / (search.mu[i] * search.wheel_loads[i])
        worst = max(worst, level)
    return worst


@kernel
def _lower(balance, free, goal, enough, search):
    """Lower the level of `goal` until it is `enough` or the smallest."""
    needed = _needed(search, goal)
    level = needed + 0.1 * abs(needed) + 1e-3
    stalled = 0
    for _ in range(MAX_LEVELS):
        if needed <= enough or stalled == 3:
            return
        for _ in range(MAX_NEWTON_STEPS):
            _write_barrier(balance, free, goal, level, search)
            if not _take_newton_step(balance, free, search):
                break
        now = _needed(search, goal)
        stalled = stalled + 1 if level - now < LEVEL_PRECISION * max(abs(now), 1e-3) else 0
        needed = now
        level = now + STAY * (level - now)


@kernel
def _take_newton_step(balance, free, search):
    """Take a damped Newton step on the barrier; False once at its minimum."""
    for k in range(free):
        search.gradient[k] = search.g[k, 0]
    if not solve_in_place(search.H, search.g, free, 1):
        return False
    decrement = 0.0
    for k in range(free):
        decrement += search.gradient[k] * search.g[k, 0]
    decrement = np.sqrt(max(decrement, 0.0))
    if not decrement > CENTRED:
        return False
    for k in range(free):
        search.y[k] -= search.g[k, 0] / (1.0 + decrement)
    apply_torques(balance, free, search)
    return True


@kernel
def _write_barrier(balance, free, goal, level, search):
    """Write gradient and Hessian of the barrier of the set at `level`."""
    search.H[:, :] = 0.0
    search.g[:, :] = 0.0
    traction = level if goal == SearchGoal.TORQUE else search.max_traction
    for i in range(6):
        if goal == SearchGoal.FRICTION:
            _add_cone(balance, free, i, level * search.mu[i], search)
        else:
            room = search.wheel_loads[i] + (level if goal == SearchGoal.LOAD else 0.0)
            _add_log(free, balance.normal[i], 1.0 / room, 1.0 / (room * room), search)
        if traction < np.inf:
            thrust = search.tangential[i] + search.resistance[i]
            above, below = traction - thrust, traction + thrust
            slope = 1.0 / below - 1.0 / above
            curvature = 1.0 / (below * below) + 1.0 / (above * above)
            _add_log(free, balance.tangential[i], slope, curvature, search)

    for j in range(free):
        for k in range(j):
            search.H[k, j] = search.H[j, k]


@kernel
def _add_log(free, row, slope, curvature, search):
    """Add -log of a linear function's room, row[1:] its gradient; of H the lower half."""
    for j in range(free):
        search.g[j, 0] -= slope * row[1 + j]
        for k in range(j + 1):
            search.H[j, k] += curvature * row[1 + j] * row[1 + k]


@kernel
def _add_cone(balance, free, i, mu, search):
    """Add -log((mu N)^2 - T^2 - S^2) of wheel i; of H the lower half."""
    n, t, s = balance.normal, balance.tangential, balance.lateral
    N, T, S = search.wheel_loads[i], search.tangential[i], search.lateral[i]
    room = mu * mu * N * N - T * T - S * S
    for j in range(free):
        nj, tj, sj = mu * mu * n[i, 1 + j], t[i, 1 + j], s[i, 1 + j]
        gj = 2.0 * (N * nj - T * tj - S * sj) / room
        search.g[j, 0] -= gj
        for k in range(j + 1):
            nk, tk, sk = n[i, 1 + k], t[i, 1 + k], s[i, 1 + k]
            gk = 2.0 * (mu * mu * N * nk - T * tk - S * sk) / room
            search.H[j, k] += gj * gk - 2.0 * (nj * nk - tj * tk - sj * sk) / room
