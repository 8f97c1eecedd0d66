"""Solving for the torques: programs about one another's answers by OSQP, equal torque else."""

from dataclasses import dataclass

import numpy as np
import osqp
from scipy import sparse

from rover_physics.traction.balance import FORCES, WHEEL_COUNT, BalanceRows
from rover_physics.traction.line_search import find_best_between, measure_peak, write_forces
from rover_physics.traction.program import (
    ROWS,
    VARIABLES,
    Reference,
    TractionQP,
    TractionWeights,
    build_traction_qp,
    check_limits,
)

SETTINGS = {
    # Of scaled rows. The default of 1e-3 leaves rows 1e-2 of the weight open.
    "eps_abs": 1e-4,
    "eps_rel": 1e-4,
    # The program is scaled already; a scaling of its own, anew each time, spoils the start.
    "scaling": 0,
    "rho": 3.0,
    "adaptive_rho_interval": 100,
    "check_termination": 5,
    "polishing": False,
    "warm_starting": True,
    "verbose": False,
}
"""Of OSQP."""
MAX_ITERATIONS = 4000
SETTLED = 0.02
"""Change of the scaled tractions, which are of order one, at which a sequence has settled."""
SOLVED = 1
"""OSQP's status_val of a solved problem; the first versions have no name for it."""


@dataclass(frozen=True, eq=False)
class TractionAnswer:
    """Torques, the forces that go with them, and by how much limits give way."""

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
    """By how much the largest torque would be above the limit in [N m]; it is cut off."""
    iterations: int
    """Iterations of OSQP."""
    programs: int
    """Programs solved."""
    fallback: bool
    """Whether OSQP failed and torques are equal."""
    status: str
    """What OSQP said last."""


class TractionWorkspace:
    """An OSQP problem that is set up once, updated in place and started from the last answer."""

    def __init__(self, max_iterations: int = MAX_ITERATIONS):
        """Set up the problem; `max_iterations` is where OSQP gives up."""
        self._cells, pattern = _find_pattern()
        self._solver = osqp.OSQP()
        unbounded = np.full(ROWS, np.inf)
        self._solver.setup(
            sparse.eye(VARIABLES, format="csc"), np.zeros(VARIABLES), pattern,
            -unbounded, unbounded, max_iter=max_iterations, **SETTINGS,
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
        solved = result.info.status_val == SOLVED and bool(np.isfinite(result.x).all())
        return result.x, result.info.iter, result.info.status, solved


def _find_pattern() -> tuple[np.ndarray, sparse.csc_matrix]:
    """Return where the entries of a sparse A are in a full one, and a sparse A."""
    rows = BalanceRows(np.ones((9, FORCES)), np.ones(9), np.ones(6), 1.0)
    reference = Reference(np.full(FORCES, 0.5), 0.5)
    A = build_traction_qp(rows, np.ones(6), 1.0, reference).A
    columns, places = np.nonzero(A.T)
    return places * VARIABLES + columns, sparse.csc_matrix(A != 0.0).astype(float)


def solve_traction(
    workspace: TractionWorkspace,
    rows: BalanceRows,
    friction: np.ndarray,
    max_torque: float,
    wheel_radius: float,
    last: np.ndarray | None = None,
    max_programs: int = 2,
    weights: TractionWeights | None = None,
) -> TractionAnswer:
    """Find the torques with the smallest peak friction utilisation.

    Args:
        workspace: OSQP's problem, kept from one call to the next.
        rows: Balance with the wanted net traction.
        friction: (6,) friction coefficients.
        max_torque: Largest torque of a wheel [N m].
        wheel_radius: Wheel radius [m].
        last: (6,) tractions of the last answer [N], near which the search starts; None starts
            from equal torques.
        max_programs: Largest number of programs, fewer where they settle before; 0 asks for
            equal torques.
        weights: What the objective weighs.

    Returns:
        The answer; equal torques, marked as fallback, where OSQP does not solve the first.

    Raises:
        ModelError: A friction coefficient or largest torque that is not above 0.
    """
    most_pull = max_torque / (wheel_radius * rows.force_unit)
    check_limits(friction, most_pull)
    weights = weights or TractionWeights()
    x = rows.complete(np.zeros(WHEEL_COUNT) if last is None else last / rows.force_unit)
    peak = measure_peak(rows, friction, x)
    status, iterations, programs = "", 0, 0
    while programs < max_programs:
        qp = build_traction_qp(rows, friction, most_pull, Reference(x, peak), weights)
        y, count, status, solved = workspace.solve(qp)
        iterations += count
        if not solved:
            break
        programs += 1
        unit = float(qp.scale[0])
        aim = rows.complete(unit * y[:WHEEL_COUNT])
        x, peak, moved = find_best_between(rows, friction, most_pull, weights, x, aim)
        if moved <= SETTLED * unit:
            break
    if programs == 0:
        x = rows.complete(np.zeros(WHEEL_COUNT))
    table, unit = np.empty((5, WHEEL_COUNT)), rows.force_unit
    torques, loads, tractions, lateral, utilisation = table
    peak, least, pull = write_forces(
        rows.along, friction, unit, wheel_radius, max_torque, x, table
    )
    return TractionAnswer(
        torques=torques,
        loads=loads,
        tractions=tractions,
        lateral=lateral,
        utilisation=utilisation,
        friction_slack=max(peak - 1.0, 0.0),
        load_slack=max(-least, 0.0),
        torque_slack=max(wheel_radius * pull - max_torque, 0.0),
        iterations=iterations,
        programs=programs,
        fallback=programs == 0 and max_programs > 0,
        status=status,
    )
