# SPDX-License-Identifier: Apache-2.0
"""Policy "optimal": the torques that need the least friction among those in equilibrium.

Three minimisations run in turn, the first two only until their constraint holds: keep all wheels
on the ground; keep the torques within their limit; minimise the friction utilisation u with
sqrt((T + u R)^2 + S^2) <= u mu N, where R is the resistance of soil. Each minimises the level of a
family of convex sets by the method of centres: damped Newton steps on a self-concordant barrier
lead to the analytic centre of the set at a level, then the level is lowered towards the value that
the centre needs.

Source: Boyd and El Ghaoui, "Method of centers for minimizing generalized eigenvalues", Linear
Algebra and its Applications 188, 1993.
"""

from enum import IntEnum

import numpy as np

from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES
from rover_physics.forces.soil import use_of_shear
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import dot, solve_in_place
from rover_physics.numerics.records import record_type

MAX_LEVELS = 60
"""Largest number of levels of one minimisation."""
MAX_NEWTON_STEPS = 12
"""Largest number of Newton steps per level."""
STAY = 0.25
"""Fraction of the distance between old level and needed level that the new level keeps, so that
the centre stays inside the set."""
MOST_TRACTION = 10.0
"""Largest torque over wheel radius [rover weights] that is looked for, whatever the limit: without
a bound the centres run away along wheels that push against each other."""
LOAD_KEPT = 1e-4
"""Least wheel load [rover weights] of a wheel on the ground."""
CENTRED = 0.1
"""Newton decrement at which the centre is accurate enough."""
LEVEL_PRECISION = 5e-5
"""Relative precision of the smallest level."""
TETHER = 0.01
"""Stiffness that holds free forces, over the rover's weight, near equal torques where a barrier
leaves them free: the loads of wheels between two faces grow without end with their tractions, and
lateral forces against each other hardly change a load."""


class SearchGoal(IntEnum):
    """Quantity that a search minimises."""

    LOAD = 0
    """The largest -N, so that all wheels stay on the ground."""
    TORQUE = 1
    """The largest torque."""
    FRICTION = 2
    """The largest friction utilisation."""


TORQUE_SEARCH = record_type(
    ("y", float, (FREE_FORCES,)),  # the free degrees, in the order of the columns of BALANCE
    ("wheel_loads", float, (6,)),  # N at y
    ("tangential", float, (6,)),  # T at y
    ("lateral", float, (6,)),  # S at y
    ("mu", float, (6,)),  # largest shear forces over the loads: the friction coefficients
    ("max_traction", float),  # largest torque over wheel radius; infinite: no limit
    ("resistance", float, (6,)),  # motion resistances R over the loads, as the wheels roll
    ("H", float, (FREE_FORCES, FREE_FORCES)),  # Hessian of the barrier
    ("g", float, (FREE_FORCES, 1)),  # gradient of the barrier, then the Newton step
    ("gradient", float, (FREE_FORCES,)),  # copy of the gradient
)
"""Work space of the search; forces over the rover's weight."""


@kernel
def apply_torques(balance, free, search):
    """Write the wheel forces at y into the search; only the first `free` elements of y count.

    With none of them, the forces are those of equal torques.
    """
    y = search.y
    for i in range(6):
        N, T, S = balance.normal[i, 0], balance.tangential[i, 0], balance.lateral[i, 0]
        for k in range(free):
            N += balance.normal[i, 1 + k] * y[k]
            T += balance.tangential[i, 1 + k] * y[k]
            S += balance.lateral[i, 1 + k] * y[k]
        search.wheel_loads[i], search.tangential[i], search.lateral[i] = N, T, S


@kernel
def minimise_friction(linkage, settings, balance, search):
    """Find the torques that need the least friction and write their forces into `search`.

    The search starts from equal torques. Lateral forces keep their equal shares if these are
    within the allowed friction. Otherwise they are free, and wheels with friction in reserve take
    over. If no torques within their limit keep all wheels on the ground, the forces are those
    closest to that.

    Args:
        linkage: LINKAGE.
        settings: SETTINGS.
        balance: BALANCE with all columns.
        search: TORQUE_SEARCH; reads `mu` and `resistance`.
    """
    weight = linkage.mass * linkage.gravity
    most = min(settings.allowed_torque / (linkage.radius * weight), MOST_TRACTION)
    found = _search(balance, np.int64(FREE_TORQUES), most, search)
    if not found or _needed(search, SearchGoal.FRICTION) > settings.allowed_friction:
        _search(balance, np.int64(FREE_FORCES), most, search)


@kernel
def _search(balance, free, max_traction, search):
    """Search with `free` degrees of freedom; return whether torques keep wheels and limit."""
    search.y[:] = 0.0
    apply_torques(balance, free, search)
    search.max_traction = np.inf
    if _needed(search, SearchGoal.LOAD) > -LOAD_KEPT:
        _lower(balance, free, SearchGoal.LOAD, -LOAD_KEPT, search)
        if _needed(search, SearchGoal.LOAD) > -LOAD_KEPT:
            return False
    if _needed(search, SearchGoal.TORQUE) >= max_traction:
        _lower(balance, free, SearchGoal.TORQUE, 0.999 * max_traction, search)
        if _needed(search, SearchGoal.TORQUE) >= max_traction:
            return False
    search.max_traction = max_traction
    _lower(balance, free, SearchGoal.FRICTION, 1e-6, search)
    return True


@kernel
def _needed(search, goal):
    """Return the smallest level whose set contains the current forces."""
    worst = -np.inf
    for i in range(6):
        if goal == SearchGoal.LOAD:
            level = -search.wheel_loads[i]
        elif goal == SearchGoal.TORQUE:
            level = abs(_thrust(search, i))
        elif _pulls_itself(search, i):
            N, T, S = search.wheel_loads[i], search.tangential[i], search.lateral[i]
            level = use_of_shear(T, S, search.resistance[i] * N, search.mu[i] * N)
        else:
            shear = np.hypot(_thrust(search, i), search.lateral[i])
            level = shear / (search.mu[i] * search.wheel_loads[i])
        worst = max(worst, level)
    return worst


@kernel
def _thrust(search, i):
    """Return the torque of wheel i over its radius, T + R."""
    return search.tangential[i] + search.resistance[i] * search.wheel_loads[i]


@kernel
def _pulls_itself(search, i):
    """Return whether the thrust of wheel i may exceed its resistance; if not, others drag it."""
    return search.mu[i] > abs(search.resistance[i])


@kernel
def _lower(balance, free, goal, enough, search):
    """Lower the level of `goal` until it is at most `enough` or cannot be lowered further."""
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
    """Take a damped Newton step on the barrier; return False at its minimum."""
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
    """Write gradient and Hessian of the barrier of the set of `goal` at `level`."""
    search.H[:, :] = 0.0
    search.g[:, :] = 0.0
    if goal != SearchGoal.FRICTION:
        for k in range(free):
            search.H[k, k], search.g[k, 0] = TETHER, TETHER * search.y[k]
    n, t, s = balance.normal, balance.tangential, balance.lateral
    for i in range(6):
        (of_N, of_T, of_S), (NN, NT, NS, TT, TS, SS) = _bend_at(search, i, goal, level)
        for j in range(free):
            N, T, S = n[i, 1 + j], t[i, 1 + j], s[i, 1 + j]
            search.g[j, 0] += of_N * N + of_T * T + of_S * S
            row = NN * N + NT * T + NS * S, NT * N + TT * T + TS * S, NS * N + TS * T + SS * S
            for k in range(j + 1):
                search.H[j, k] += dot(row, (n[i, 1 + k], t[i, 1 + k], s[i, 1 + k]))
    for j in range(free):
        for k in range(j):
            search.H[k, j] = search.H[j, k]


@kernel
def _bend_at(search, i, goal, level):
    """Return gradient and Hessian of the barrier of wheel i by its N, T and S.

    The barrier is the sum of -log of the slacks: of the load or, for FRICTION, of the cone,
    (u mu N)^2 - (T + u R)^2 - S^2 at level u, and of the torque, T + R to either side. For a wheel
    that others drag, R has no factor u in the cone.
    """
    N, S, back = search.wheel_loads[i], search.lateral[i], search.resistance[i]
    of_N = of_T = NN = NT = TT = 0.0
    traction = level if goal == SearchGoal.TORQUE else search.max_traction
    if traction < np.inf:
        thrust = _thrust(search, i)
        above, below = 1.0 / (traction - thrust), 1.0 / (traction + thrust)
        of_T, TT = above - below, above * above + below * below
        of_N, NN, NT = back * of_T, back * back * TT, back * TT
    if goal != SearchGoal.FRICTION:
        room = N + (level if goal == SearchGoal.LOAD else 0.0)
        return (of_N - 1.0 / room, of_T, 0.0), (NN + 1.0 / (room * room), NT, 0.0, TT, 0.0, 0.0)
    back *= level if _pulls_itself(search, i) else 1.0
    T, square = search.tangential[i] + back * N, (level * search.mu[i]) ** 2
    half = 0.5 * (square * N * N - T * T - S * S)
    by_N, by_T, by_S = (back * T - square * N) / half, T / half, S / half
    NN += by_N * by_N + (back * back - square) / half
    NT += by_N * by_T + back / half
    TT += by_T * by_T + 1.0 / half
    SS = by_S * by_S + 1.0 / half
    return (of_N + by_N, of_T + by_T, by_S), (NN, NT, by_N * by_S, TT, by_T * by_S, SS)
