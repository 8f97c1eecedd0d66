# SPDX-License-Identifier: Apache-2.0
"""Solving for the torques: a sequence of quadratic programs by OSQP, each about the last one."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import osqp
from scipy import sparse

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record
from rover_physics.traction.balance import MEASURED_BALANCE, BalanceRows
from rover_physics.traction.layout import (
    FORCES,
    LATERAL_SHARE,
    LATERAL_SLOPE,
    LOAD,
    ROWS,
    TRACTION,
    TRACTIONS,
    VARIABLES,
)
from rover_physics.traction.line_search import find_best_between, measure_peak
from rover_physics.traction.program import ProgramInputs, Reference, TractionQP, build_traction_qp

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
WHEEL_FORCES = ("torques", "loads", "tractions", "lateral", "utilisation")
"""Rows of a table of wheel forces."""


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
        self.qp = TractionQP()
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
    ones = new_record(
        MEASURED_BALANCE, A=1.0, b=1.0, lateral_shares=1.0, directions=1.0, force_unit=1.0
    )
    inputs = ProgramInputs(np.ones(WHEEL_COUNT), 1.0, 1.0)
    reference = Reference(np.full(FORCES, 0.5), 0.5)
    A = build_traction_qp(BalanceRows(array_of(ones)), inputs, reference).A
    columns, rows = np.nonzero(A.T)
    return rows * VARIABLES + columns, sparse.csc_matrix(A != 0.0).astype(float)


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
    forces = Reference(x, measure_peak(rows, inputs, x))
    status, iterations, programs = "", 0, 0
    while programs < max_programs:
        qp = build_traction_qp(rows, inputs, forces, workspace.qp)
        y, count, status, solved = workspace.solve(qp)
        iterations += count
        if not solved:
            break
        programs += 1
        unit = float(qp.scale[TRACTION])
        aim = rows.complete(unit * y[TRACTIONS])
        forces, moved = find_best_between(rows, inputs, forces, aim)
        if moved <= CONVERGED_SHARE * unit:
            break
    x = forces.x if programs else rows.pull_equally()
    fallback = programs == 0 < max_programs
    run = {"iterations": iterations, "programs": programs, "fallback": fallback, "status": status}
    return _describe_answer(rows, inputs, x, run)


def _describe_answer(
    rows: BalanceRows, inputs: ProgramInputs, x: np.ndarray, run: dict[str, Any]
) -> TractionAnswer:
    """Return forces x (14,) in SI units, with what the run of the programs came to."""
    table = np.empty((len(WHEEL_FORCES), WHEEL_COUNT))
    peak, min_load, max_traction = write_wheel_forces(rows.packed, inputs.packed, x, table)
    torques, loads, tractions, lateral, utilisation = table
    return TractionAnswer(
        torques, loads, tractions, lateral, utilisation,
        friction_slack=max(peak - 1.0, 0.0),
        load_slack=max(-min_load, 0.0),
        torque_slack=max(inputs.radius * max_traction - inputs.max_torque, 0.0),
        **run,
    )  # fmt: skip


@kernel
def write_wheel_forces(balances, all_inputs, x, table):
    """Write forces x (14,), in force units, into a table of wheel forces.

    Args:
        balances: Array (1,) of MEASURED_BALANCE.
        all_inputs: Array (1,) of PROGRAM_INPUTS; torques are cut off at its largest.
        x: (14,) tractions, loads and lateral terms in force units.
        table: (5, 6) rows as in WHEEL_FORCES: torques [N m], loads, tractions and lateral forces
            [N], utilisations, infinite where there is no load.

    Returns:
        Largest utilisation, smallest load [N], largest size of a traction [N].
    """
    balance, inputs = balances[0], all_inputs[0]
    unit, limit = balance.force_unit, inputs.max_torque
    torques, loads, tractions = table[0], table[1], table[2]
    laterals, utilisation = table[3], table[4]
    peak, min_load, max_traction = 0.0, np.inf, 0.0
    for wheel in range(WHEEL_COUNT):
        traction, load = unit * x[TRACTION + wheel], unit * x[LOAD + wheel]
        shares = balance.lateral_shares[wheel]
        lateral = unit * (x[LATERAL_SHARE] * shares[0] + x[LATERAL_SLOPE] * shares[1])
        across = np.sqrt(traction * traction + lateral * lateral)
        used = across / (inputs.friction[wheel] * load) if load > 0.0 else np.inf
        torques[wheel] = min(max(inputs.radius * traction, -limit), limit)
        loads[wheel], tractions[wheel], laterals[wheel] = load, traction, lateral
        utilisation[wheel] = used
        peak, min_load = max(peak, used), min(min_load, load)
        max_traction = max(max_traction, abs(traction))
    return peak, min_load, max_traction
