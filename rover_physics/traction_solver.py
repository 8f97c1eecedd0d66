"""Solving for the torques: programmes about one another's answers by OSQP, equal torque else."""

from dataclasses import dataclass

import numpy as np
import osqp
from osqp import ext_builtin as ext
from scipy import sparse

from rover_physics.kernels import kernel
from rover_physics.traction import (
    LEAST_LOAD,
    ROWS,
    VARIABLES,
    Reference,
    TractionQP,
    TractionWeights,
    build_traction_qp,
    check_limits,
)
from rover_physics.traction_rows import FORCES, WHEEL_COUNT, BalanceRows

SETTINGS = {
    # Of scaled rows. The default of 1e-3 leaves rows 1e-2 of the weight open.
    "eps_abs": 1e-4,
    "eps_rel": 1e-4,
    # The programme is scaled already; a scaling of its own, anew each time, spoils the start.
    "scaling": 0,
    "rho": 5.0,
    "adaptive_rho_interval": 100,
    "check_termination": 5,
    "polishing": False,
    "warm_starting": True,
    "verbose": False,
}
"""Of OSQP."""
UNBOUNDED = 1e30
"""What OSQP takes for infinite."""
MOST_ITERATIONS = 4000
SETTLED = 0.02
"""Change of the scaled tractions, which are of order one, at which a sequence has settled."""
SOLVED = osqp.SolverStatus.OSQP_SOLVED


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
    programmes: int
    """Programmes solved."""
    fallback: bool
    """Whether OSQP failed and torques are equal."""
    status: str
    """What OSQP said last."""


class TractionWorkspace:
    """An OSQP problem that is set up once, updated in place and started from the last answer.

    It works on OSQP's extension module: `osqp.OSQP`, which stands around it, takes longer to copy
    every answer and all that there is to say about it than OSQP takes to solve.
    """

    def __init__(self, most_iterations: int = MOST_ITERATIONS):
        """Set up the problem; `most_iterations` is where OSQP gives up."""
        self._cells, pattern = _find_pattern()
        settings = ext.OSQPSettings()
        ext.osqp_set_default_settings(settings)
        for name, value in SETTINGS.items():
            setattr(settings, name, value)
        settings.max_iter = most_iterations
        self._P, self._A = ext.CSC(sparse.eye(VARIABLES, format="csc")), ext.CSC(pattern)
        self._vectors = np.zeros(VARIABLES), np.full(ROWS, -UNBOUNDED), np.full(ROWS, UNBOUNDED)
        self._solver = ext.OSQPSolver(
            self._P, self._vectors[0], self._A, *self._vectors[1:], ROWS, VARIABLES, settings
        )

    def solve(self, qp: TractionQP) -> tuple[np.ndarray, int, str, bool]:
        """Solve a programme.

        Returns:
            Variables (18,), iterations, OSQP's words for its status, whether it was solved.
        """
        solver, values = self._solver, qp.A.ravel()[self._cells]
        lower, upper = np.maximum(qp.lower, -UNBOUNDED), np.minimum(qp.upper, UNBOUNDED)
        failed = solver.update_data_vec(q=qp.q, l=lower, u=upper)
        failed = solver.update_data_mat(P_x=qp.P, P_i=None, A_x=values, A_i=None) or failed
        if failed:
            return qp.start, 0, f"OSQP refuses the programme, error {failed}", False
        solver.warm_start(qp.start, None)
        solver.solve()
        info, y = solver.info, solver.solution.x.copy()
        solved = info.status_val == SOLVED and bool(np.isfinite(y).all())
        return y, info.iter, info.status, solved


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
    most_programmes: int = 2,
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
        most_programmes: Largest number of programmes, fewer where they settle before; 0 asks for
            equal torques.
        weights: What the objective weighs.

    Returns:
        The answer; equal torques, marked as fallback, where OSQP does not solve the first.

    Raises:
        ModelError: A friction coefficient or largest torque that is not above 0.
    """
    most_pull = max_torque / (wheel_radius * rows.force_unit)
    check_limits(friction, most_pull)
    pulls = np.zeros(WHEEL_COUNT) if last is None else last / rows.force_unit
    x = rows.complete(pulls)
    peak = measure_peak(rows, friction, x)
    best, best_merit, status, iterations, programmes = None, np.inf, "", 0, 0
    while programmes < most_programmes:
        qp = build_traction_qp(rows, friction, most_pull, Reference(x, peak), weights)
        y, count, status, solved = workspace.solve(qp)
        iterations += count
        if not solved:
            break
        programmes += 1
        x = rows.complete((qp.scale * y + qp.shift)[:WHEEL_COUNT])
        peak = measure_peak(rows, friction, x)
        merit = peak + _excess(x, most_pull)
        if merit < best_merit:
            best, best_merit = x, merit
        if np.abs(y[:WHEEL_COUNT] - qp.start[:WHEEL_COUNT]).max() <= SETTLED:
            break
    fallback = best is None and most_programmes > 0
    x = rows.complete(np.zeros(WHEEL_COUNT)) if best is None else best
    forces = _describe(rows, friction, x, max_torque, wheel_radius)
    return TractionAnswer(
        **forces, iterations=iterations, programmes=programmes, fallback=fallback, status=status
    )


def measure_utilisation(rows: BalanceRows, friction: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return sqrt(T^2 + S^2) / (mu N) (6,) of x (14,), with loads of LEAST_LOAD at least."""
    used = np.empty(WHEEL_COUNT)
    _measure(rows.along, friction, x, used)
    return used


def measure_peak(rows: BalanceRows, friction: np.ndarray, x: np.ndarray) -> float:
    """Return the largest of `measure_utilisation`."""
    return _measure(rows.along, friction, x, np.empty(WHEEL_COUNT))


@kernel
def _measure(along, friction, x, used):
    """Write the utilisations (6,) and return the largest."""
    peak = 0.0
    for wheel in range(6):
        lateral = x[12] + x[13] * along[wheel]
        across = np.sqrt(x[wheel] * x[wheel] + lateral * lateral)
        used[wheel] = across / (friction[wheel] * max(x[6 + wheel], LEAST_LOAD))
        peak = max(peak, used[wheel])
    return peak


@kernel
def _excess(x, most_pull):
    """Return by how much contact and torque limits are broken, in force units."""
    pull = lift = 0.0
    for wheel in range(6):
        pull = max(pull, abs(x[wheel]) - (1.0 + 1e-4) * most_pull)
        lift = max(lift, -x[6 + wheel])
    return 10.0 * (pull + lift)


@kernel
def _write_forces(along, friction, unit, x, used, lateral):
    """Write utilisations, infinite without load, and lateral forces in [N]."""
    for wheel in range(6):
        share = x[12] + x[13] * along[wheel]
        lateral[wheel] = unit * share
        across = np.sqrt(x[wheel] * x[wheel] + share * share)
        used[wheel] = across / (friction[wheel] * x[6 + wheel]) if x[6 + wheel] > 0.0 else np.inf


def _describe(
    rows: BalanceRows, friction: np.ndarray, x: np.ndarray, max_torque: float, radius: float
) -> dict:
    """Return the forces of an answer in SI units and what is left of the limits."""
    T, N = rows.force_unit * x[:6], rows.force_unit * x[6:12]
    utilisation, lateral = np.empty((2, WHEEL_COUNT))
    _write_forces(rows.along, friction, rows.force_unit, x, utilisation, lateral)
    torques = radius * T
    return {
        "torques": np.minimum(np.maximum(torques, -max_torque), max_torque),
        "loads": N,
        "tractions": T,
        "lateral": lateral,
        "utilisation": utilisation,
        "friction_slack": max(float(utilisation.max()) - 1.0, 0.0),
        "load_slack": max(-float(N.min()), 0.0),
        "torque_slack": max(float(np.abs(torques).max()) - max_torque, 0.0),
    }
