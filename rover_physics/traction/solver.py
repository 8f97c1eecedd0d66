# SPDX-License-Identifier: Apache-2.0
"""Solving for the torques: a sequence of quadratic programs by OSQP, each about the last one.

A program knows cones as they are about the last forces; far from these they may be wrong, and a
sequence of answers may oscillate. So the best place on the line from the last forces to an answer
is searched. Where the answer has a smaller peak, peaks fall from the last forces on, so that the
best place never has a larger one. The balance is linear: all on the line keep it.
"""

from dataclasses import dataclass

import numpy as np
import osqp
from scipy import sparse

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.traction.balance import (
    EQUATIONS,
    FORCES,
    LATERAL_SHARE,
    LATERAL_SLOPE,
    LOAD,
    TRACTION,
    TRACTIONS,
    BalanceRows,
)
from rover_physics.traction.program import (
    EFFORT_WEIGHT,
    MIN_LOAD,
    MIN_PEAK,
    PEAK_WEIGHT,
    ROWS,
    SLACK_PRICE,
    VARIABLES,
    ProgramInputs,
    TractionQP,
    new_program,
    write_program,
)

OSQP_SETTINGS = {
    # Of scaled rows. The default of 1e-3 leaves rows 1e-2 of the weight open.
    "eps_abs": 1e-4,
    "eps_rel": 1e-4,
    # The program is scaled already; OSQP's own scaling, anew each time, spoils the start.
    "scaling": 0,
    "rho": 3.0,
    "adaptive_rho_interval": 100,
    "check_termination": 5,
    "polishing": False,
    "warm_starting": True,
    "verbose": False,
}
"""Settings of OSQP."""
MAX_ITERATIONS = 4000
"""Iterations after which OSQP gives up."""
MAX_PROGRAMS = 2
"""Programs of one answer; more change little where the last answer is near."""
CONVERGED_SHARE = 0.02
"""Change of the scaled tractions, which are of order one, at which a sequence has converged."""
OSQP_SOLVED = 1
"""OSQP's status_val of a solved problem; the first versions have no name for it."""
LINE_STEPS, PLACES = 20, 31
"""Steps from the last forces to an answer, and number of places on the line that are looked at;
some are beyond the answer."""
ROUNDING = 1e-4
"""Share of the largest pull by which OSQP may exceed it."""


@dataclass(frozen=True, eq=False)
class TractionAnswer:
    """Torques, the forces that go with them, and by how much limits are exceeded."""

    torques: np.ndarray
    """(6,) torques in [N m], within the limit."""
    loads: np.ndarray
    """(6,) wheel loads in [N]."""
    tractions: np.ndarray
    """(6,) tractions in [N]."""
    lateral: np.ndarray
    """(6,) lateral forces in [N]."""
    utilisation: np.ndarray
    """(6,) sqrt(T^2 + S^2) / (mu N); infinite where there is no load."""
    friction_slack: float
    """By how much the peak utilisation is above 1."""
    load_slack: float
    """By how much the smallest load is below 0 in [N]."""
    torque_slack: float
    """By how much the largest torque would be above the limit in [N m]; torques are cut off."""
    iterations: int
    """Iterations of OSQP."""
    programs: int
    """Programs solved."""
    fallback: bool
    """True if OSQP failed and torques are equal; see `solve_traction`."""
    status: str
    """OSQP's last status in its own words."""


class TractionWorkspace:
    """An OSQP problem that is set up once, updated in place and started from the last answer."""

    def __init__(self, max_iterations: int = MAX_ITERATIONS):
        """Set up the problem; OSQP gives up after `max_iterations`."""
        self.qp = new_program()
        """The program that is written anew each time."""
        self._cells, pattern = _find_pattern()
        self._solver = osqp.OSQP()
        unbounded = np.full(ROWS, np.inf)
        self._solver.setup(
            sparse.eye(VARIABLES, format="csc"), np.zeros(VARIABLES), pattern,
            -unbounded, unbounded, max_iter=max_iterations, **OSQP_SETTINGS,
        )  # fmt: skip

    def solve(self, qp: TractionQP) -> tuple[np.ndarray, int, str, bool]:
        """Solve a program.

        Returns:
            Variables (18,), iterations, OSQP's words for its status, whether it was solved.
        """
        values = qp.A.ravel()[self._cells]
        self._solver.update(Px=qp.P, Ax=values, q=qp.q, l=qp.lower, u=qp.upper)
        self._solver.warm_start(x=qp.start)
        result = self._solver.solve(raise_error=False)
        solved = result.info.status_val == OSQP_SOLVED and bool(np.isfinite(result.x).all())
        return result.x, result.info.iter, result.info.status, solved


def _find_pattern() -> tuple[np.ndarray, sparse.csc_matrix]:
    """Return where the entries of a sparse A are in a full one, and a sparse A."""
    A, shares, each = np.ones((EQUATIONS, FORCES)), np.ones((WHEEL_COUNT, 2)), np.ones(WHEEL_COUNT)
    rows, qp = BalanceRows(A, np.ones(EQUATIONS), shares, each, 1.0), new_program()
    write_program(rows, each, 1.0, np.full(FORCES, 0.5), 0.5, qp)
    columns, entries = np.nonzero(qp.A.T)
    return entries * VARIABLES + columns, sparse.csc_matrix(qp.A != 0.0).astype(float)


def solve_traction(
    workspace: TractionWorkspace,
    rows: BalanceRows,
    inputs: ProgramInputs,
    last: np.ndarray | None = None,
    max_programs: int = MAX_PROGRAMS,
) -> TractionAnswer:
    """Find the torques with the smallest peak friction utilisation.

    If OSQP does not solve the first program (its status is not "solved", or a variable is not
    finite), all wheels get the same torque, and the answer is marked as fallback. Equal torques
    always keep the balance, so the rover drives on, but a wheel may slip while others still have
    friction in reserve.

    Args:
        workspace: OSQP's problem, kept from one call to the next.
        rows: Balance with the wanted net traction.
        inputs: Friction and torque of the wheels.
        last: (6,) tractions of the last answer [N], near which the search starts; None starts
            from equal torques.
        max_programs: Largest number of programs, fewer where they converge before; 0 asks for
            equal torques.
    """
    x = rows.pull_equally() if last is None else rows.complete(last / rows.force_unit)
    shares, friction, qp = rows.lateral_shares, inputs.friction, workspace.qp
    max_pull = inputs.max_torque / (inputs.radius * rows.force_unit)
    status, iterations, programs = "", 0, 0
    while programs < max_programs:
        write_program(rows, friction, max_pull, x, _measure_peak(shares, friction, x), qp)
        y, count, status, solved = workspace.solve(qp)
        iterations += count
        if not solved:
            break
        programs += 1
        unit = float(qp.scale[TRACTION])
        start, aim, x = x, rows.complete(unit * y[TRACTIONS]), np.empty(FORCES)
        if _search_line(shares, friction, max_pull, (start, aim, x)) <= CONVERGED_SHARE * unit:
            break
    x = x if programs else rows.pull_equally()
    table = np.empty((5, WHEEL_COUNT))
    peak, min_load, max_torque = _measure_wheels(
        shares, rows.force_unit, friction, inputs.max_torque, inputs.radius, x, table
    )
    torques, loads, tractions, lateral, utilisation = table
    return TractionAnswer(
        torques, loads, tractions, lateral, utilisation,
        friction_slack=max(peak - 1.0, 0.0),
        load_slack=max(-min_load, 0.0),
        torque_slack=max(max_torque - inputs.max_torque, 0.0),
        iterations=iterations,
        programs=programs,
        fallback=programs == 0 < max_programs,
        status=status,
    )  # fmt: skip


@kernel
def _measure_wheels(shares, unit, friction, limit, radius, x, table):
    """Write the first five fields of a TractionAnswer into a table (5, 6), for forces x (14,).

    Returns:
        Largest utilisation, smallest load [N], largest torque without the limit [N m].
    """
    peak, min_load, max_traction = 0.0, np.inf, 0.0
    for wheel in range(WHEEL_COUNT):
        traction, load = unit * x[TRACTION + wheel], unit * x[LOAD + wheel]
        own = shares[wheel]
        lateral = unit * (x[LATERAL_SHARE] * own[0] + x[LATERAL_SLOPE] * own[1])
        across = np.sqrt(traction * traction + lateral * lateral)
        used = across / (friction[wheel] * load) if load > 0.0 else np.inf
        table[0, wheel] = min(max(radius * traction, -limit), limit)
        table[1, wheel], table[2, wheel], table[3, wheel] = load, traction, lateral
        table[4, wheel] = used
        peak, min_load = max(peak, used), min(min_load, load)
        max_traction = max(max_traction, abs(traction))
    return peak, min_load, radius * max_traction


@kernel
def _measure_peak(shares, friction, x):
    """Return the largest sqrt(T^2 + S^2) / (mu N) of x (14,), with loads of MIN_LOAD at least."""
    peak = 0.0
    for wheel in range(WHEEL_COUNT):
        lateral = x[LATERAL_SHARE] * shares[wheel, 0] + x[LATERAL_SLOPE] * shares[wheel, 1]
        across = np.sqrt(x[TRACTION + wheel] * x[TRACTION + wheel] + lateral * lateral)
        peak = max(peak, across / (friction[wheel] * max(x[LOAD + wheel], MIN_LOAD)))
    return peak


@kernel
def _search_line(shares, friction, max_pull, points):
    """Write the forces of the smallest cost at places on a line; return how far tractions moved.

    Args:
        shares: (6, 2) `lateral_shares` of the balance.
        friction: (6,) friction coefficients.
        max_pull: Largest traction of a motor in force units.
        points: The last forces, the answer of a program, and the forces to write, (14,) each, in
            force units.
    """
    start, _, x = points
    # What the program divides by about `start`: the unit of peaks, and that of tractions.
    mean_friction = 0.0
    for wheel in range(WHEEL_COUNT):
        mean_friction += friction[wheel] / WHEEL_COUNT
    peak_unit = max(_measure_peak(shares, friction, start), MIN_PEAK)
    units = max_pull, peak_unit, peak_unit * mean_friction
    place, least = 0.0, np.inf
    for step in range(PLACES):
        cost = _cost_at(step / LINE_STEPS, shares, friction, points, units)
        if cost <= least:
            place, least = step / LINE_STEPS, cost
    _cost_at(place, shares, friction, points, units)
    moved = 0.0
    for k in range(TRACTION, TRACTION + WHEEL_COUNT):
        moved = max(moved, abs(x[k] - start[k]))
    return moved


@kernel
def _cost_at(place, shares, friction, points, units):
    """Write the forces at a place on the line, and return what the program minimises.

    `points` are as for `_search_line`; `units` are the largest pull in force units, the unit of
    peaks, and that of tractions.
    """
    start, aim, x = points
    max_pull, peak_unit, unit = units
    squares = pull = lift = 0.0
    for k in range(FORCES):
        x[k] = start[k] + place * (aim[k] - start[k])
    for wheel in range(WHEEL_COUNT):
        traction = x[TRACTION + wheel]
        squares += traction * traction
        pull = max(pull, abs(traction) - (1.0 + ROUNDING) * max_pull)
        lift = max(lift, -x[LOAD + wheel])
    peak = _measure_peak(shares, friction, x) / peak_unit
    cost = 0.5 * (PEAK_WEIGHT * peak * peak + EFFORT_WEIGHT * squares / (unit * unit))
    return cost + SLACK_PRICE * (max(peak - 1.0 / peak_unit, 0.0) + (pull + lift) / unit)
