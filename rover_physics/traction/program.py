"""The quadratic program that shares the torques: no wheel slips before all give their part.

Variables, x = scale * variables + shift in sixths of the weight: tractions T (6), loads N (6),
lateral terms s0 and s1 with S_i = s0 + s1 along_i, the peak friction utilisation u, and three
slacks: of the friction limit, of contact and of the torque limit. Rows: the nine equations of the
balance; for each wheel the friction cone that u opens; u <= 1, N >= 0 and |T| <= largest torque
over wheel radius, each with its slack; u and slacks >= 0. So an answer always exists, and the
slacks say by how much it gives way. `scale` makes tractions and peak of order one: a peak of 0.1
is no smaller a matter than one of 1.

The cone sqrt(T^2 + S^2) <= u mu N is nothing that a quadratic program can hold:

- u N is a product. It is expanded to first order about the last peak and load, so that the
  smallest peak is found by a sequence of programs, as Dinkelbach does for ratios. A controller,
  whose last answer is near, needs one or two of them.
- The cone is round. It is replaced by SIDES of its tangents, one of them where the last forces
  point. Where the sequence settles that is exact; elsewhere the polygon is outside the cone.

So an answer is looked at by the round cone and the product, both from the last forces on towards
it, and the best place on that line is taken (`traction_merit`): the peak never rises from one
program to the next, and what is reported is the utilisation by the round cone.

The change from the last forces is weighed as well: it makes the program well conditioned, and
it vanishes where the sequence settles, so that it costs nothing there (a proximal point method).

Sources: Crouzeix, Ferland and Schaible, "An algorithm for generalized fractional programs",
Journal of Optimization Theory and Applications 47, 1985; Rockafellar, "Monotone operators and the
proximal point algorithm", SIAM Journal on Control and Optimization 14, 1976.
"""

from dataclasses import dataclass

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.numerics.kernels import kernel
from rover_physics.traction.balance import WHEEL_COUNT, BalanceRows

SIDES = 4
"""Tangents around each friction cone."""
SHARE, SLOPE, PEAK = 12, 13, 14
"""Columns of s0, s1 and u; before them T and N."""
FRICTION_SLACK, LOAD_SLACK, TORQUE_SLACK = 15, 16, 17
VARIABLES = 18
CONES = 9
LIMIT = CONES + WHEEL_COUNT * SIDES
LOAD_ROWS = LIMIT + 1
FORWARD = LOAD_ROWS + WHEEL_COUNT
BACKWARD = FORWARD + WHEEL_COUNT
SIGNS = BACKWARD + WHEEL_COUNT
ROWS = SIGNS + 4
"""Rows: balance (9), cones, limit of the peak, contacts (6), torques (2 x 6), signs (4)."""
MIN_LOAD, MIN_PEAK, MAX_PEAK = 0.05, 0.02, 3.0
"""Bounds of what the cones are expanded about: load in sixths of the weight, utilisation."""
REGULARISATION = 1e-2
"""Curvature of what has no cost: loads and slacks."""


@dataclass(frozen=True)
class TractionWeights:
    """What the objective weighs, for scaled variables: tractions and peak are of order one.

    1/2 peak u^2 + 1/2 effort |T|^2 + 1/2 change |(T, s0, s1) - last|^2 + slack * (slacks).
    """

    peak: float = 10.0
    """Weight of the squared peak utilisation. It comes first: 1,000 times the effort."""
    effort: float = 0.01
    """Weight of the squared tractions: it decides where several sets have the smallest peak."""
    change: float = 3.0
    """Weight of the squared change since the last answer; smaller ones take OSQP longer."""
    slack: float = 100.0
    """Price of a slack: more than a peak can be worth, so that no limit gives way to another."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The last answer, about which the program is written."""

    x: np.ndarray
    """(14,) tractions, loads and lateral terms in force units."""
    peak: float
    """Its peak friction utilisation, or what is wanted of it."""


@dataclass(frozen=True, eq=False)
class TractionQP:
    """minimise 1/2 y'Py + q'y subject to lower <= A y <= upper; see the module for rows."""

    P: np.ndarray
    """(18,) diagonal of the cost's matrix."""
    q: np.ndarray
    """(18,) linear cost."""
    A: np.ndarray
    """(ROWS, 18) rows."""
    lower: np.ndarray
    """(ROWS,) lower bounds."""
    upper: np.ndarray
    """(ROWS,) upper bounds."""
    scale: np.ndarray
    """(18,) x = scale * y + shift in force units, and in units of one for the peak."""
    shift: np.ndarray
    """(18,) see scale."""
    start: np.ndarray
    """(18,) y of the reference."""


def build_traction_qp(
    rows: BalanceRows,
    friction: np.ndarray,
    most_pull: float,
    reference: Reference,
    weights: TractionWeights | None = None,
) -> TractionQP:
    """Write the program for one state of the rover.

    Args:
        rows: Balance at that state, with the wanted net traction.
        friction: (6,) friction coefficients.
        most_pull: Largest torque over the wheel radius, in force units.
        reference: The last answer; at first that of equal torques.
        weights: What the objective weighs.

    Raises:
        ModelError: A friction coefficient or largest pull that is not above 0.
    """
    weights = weights or TractionWeights()
    check_limits(friction, most_pull)
    vectors, A, bounds = np.zeros((5, VARIABLES)), np.zeros((ROWS, VARIABLES)), np.empty((2, ROWS))
    peak = min(max(reference.peak, MIN_PEAK), MAX_PEAK)
    unit = peak * float(friction.sum()) / WHEEL_COUNT
    P, q, scale, shift, start = vectors
    _write_constraints(
        rows.A, rows.b, rows.along, friction, most_pull, reference.x, peak, unit,
        A, bounds[0], bounds[1], shift,
    )  # fmt: skip
    _write_start(reference.x, peak, unit, scale, shift, start)
    _write_costs(weights.peak, weights.effort, weights.change, weights.slack, start, P, q)
    return TractionQP(P, q, A, bounds[0], bounds[1], scale, shift, start)


def check_limits(friction: np.ndarray, most_pull: float) -> None:
    """Raise ModelError where a friction coefficient (6,) or the largest pull is not above 0."""
    if not (friction.min() > 0.0 and most_pull > 0.0):
        raise ModelError(f"friction {friction} and largest pull {most_pull} must all be above 0")


@kernel
def _write_start(last, peak, unit, scale, shift, start):
    """Write the units of the variables, and the last answer in them."""
    for k in range(VARIABLES):
        scale[k] = peak if k in (PEAK, FRICTION_SLACK) else unit
        start[k] = (last[k] - shift[k]) / unit if k < PEAK else 0.0
    start[PEAK] = 1.0


@kernel
def _write_costs(peak, effort, change, slack, start, P, q):
    """Write the diagonal and the linear part of the cost."""
    for k in range(VARIABLES):
        P[k], q[k] = REGULARISATION, 0.0
        if k < 6 or k in (SHARE, SLOPE):
            P[k] = change + (effort if k < 6 else REGULARISATION)
            q[k] = -change * start[k]
        if k >= FRICTION_SLACK:
            P[k], q[k] = 0.1 * slack, slack
    P[PEAK] = peak


@kernel
def _write_constraints(
    balance, wanted, along, friction, most_pull, last, peak, unit, A, lower, upper, shift
):
    """Write all rows, each divided by `unit`, and the shift of the loads; A comes as zeros."""
    lower[:] = -np.inf
    upper[:] = np.inf
    for wheel in range(6):
        shift[6 + wheel] = max(last[6 + wheel], MIN_LOAD)
    for row in range(9):
        room = wanted[row]
        for column in range(14):
            A[row, column] = balance[row, column]
            room -= balance[row, column] * shift[column]
        lower[row] = upper[row] = room / unit
    for wheel in range(6):
        lateral = last[12] + last[13] * along[wheel]
        direction = np.arctan2(lateral, last[wheel])
        load, mu = shift[6 + wheel], friction[wheel]
        for side in range(SIDES):
            row = CONES + wheel * SIDES + side
            angle = direction + 2.0 * np.pi * side / SIDES
            A[row, wheel] = np.cos(angle)
            A[row, 12] = np.sin(angle)
            A[row, 13] = np.sin(angle) * along[wheel]
            A[row, 6 + wheel] = -mu * peak
            A[row, 14] = -mu * load * peak / unit
            upper[row] = 0.0
        row = LOAD_ROWS + wheel
        A[row, 6 + wheel] = A[row, 16] = 1.0
        lower[row] = -load / unit
        for row, sign in ((FORWARD + wheel, 1.0), (BACKWARD + wheel, -1.0)):
            A[row, wheel] = sign
            A[row, 17] = -1.0
            upper[row] = most_pull / unit
    A[LIMIT, 14], A[LIMIT, 15] = 1.0, -1.0
    upper[LIMIT] = 1.0 / peak
    for k in range(4):
        A[SIGNS + k, 14 + k] = 1.0
        lower[SIGNS + k] = 0.0
