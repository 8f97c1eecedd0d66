# SPDX-License-Identifier: Apache-2.0
"""The quadratic program (QP) that shares the torques: no wheel slips before all give their part.

Variables, x = scale * y + shift in sixths of the weight: tractions T (6), loads N (6), lateral
terms s0 and s1, the peak friction utilisation u, and three slacks: of the friction limit, of
contact and of the torque limit. T and S are along and across each wheel's own heading. Rows: the
nine equations of the balance; for each wheel the friction cone that u opens; u <= 1, N >= 0 and
|T| <= largest torque over wheel radius, each with its slack; u and slacks >= 0. So an answer
always exists, and the slacks say by how much a limit is exceeded. `scale` makes tractions and peak
of order one: a peak of 0.1 matters as much as one of 1. The constants name all variables and rows.

A quadratic program cannot hold the cone sqrt(T^2 + S^2) <= u mu N itself:

- u N is a product. It is expanded to first order about the last peak and load, so that the
  smallest peak is found by a sequence of programs, as Dinkelbach does for ratios. A controller,
  whose last answer is near, needs one or two of them.
- The cone is round. It is replaced by CONE_SIDES of its tangents, one of them where the last
  forces point. Where the sequence converges that is exact; elsewhere the polygon is outside the
  cone.

So an answer is measured by the round cone and the product, from the last forces on towards it, and
the best place on that line is taken (`solver.py`): the peak never rises from one program to the
next, and the reported utilisation is that of the round cone.

The change from the last forces has a weight as well: it makes the program well conditioned, and
it vanishes where the sequence converges, so that it costs nothing there (a proximal point method).

Sources: Crouzeix, Ferland and Schaible, "An algorithm for generalized fractional programs",
Journal of Optimization Theory and Applications 47, 1985; Rockafellar, "Monotone operators and the
proximal point algorithm", SIAM Journal on Control and Optimization 14, 1976.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.traction.balance import (
    EQUATIONS,
    FORCES,
    LATERAL_SHARE,
    LATERAL_SLOPE,
    LOAD,
    TRACTION,
)

# Variables after the FORCES of the balance, and rows; "First of" is meant as there.
PEAK = FORCES
"""The largest friction utilisation u of all wheels."""
FRICTION_SLACK = PEAK + 1
"""Excess of the peak over 1."""
LOAD_SLACK = FRICTION_SLACK + 1
"""Amount by which the smallest load is below 0."""
TORQUE_SLACK = LOAD_SLACK + 1
"""Excess of the largest traction over the largest pull of a motor."""
VARIABLES = TORQUE_SLACK + 1
"""Number of variables."""

CONE_SIDES = 4
"""Number of tangents that replace the friction cone of one wheel."""
BALANCE_ROWS = 0
"""First of the EQUATIONS rows of the balance."""
CONE_ROWS = BALANCE_ROWS + EQUATIONS
"""First of the tangents of the friction cones: CONE_SIDES of the first wheel, then the next."""
PEAK_LIMIT_ROW = CONE_ROWS + WHEEL_COUNT * CONE_SIDES
"""Row that limits the peak utilisation to 1 plus its slack."""
LOAD_ROWS = PEAK_LIMIT_ROW + 1
"""First of the six rows that keep a load at or above 0 minus its slack."""
FORWARD_PULL_ROWS = LOAD_ROWS + WHEEL_COUNT
"""First of the six rows that limit a traction to the motor's largest pull plus its slack."""
BACKWARD_PULL_ROWS = FORWARD_PULL_ROWS + WHEEL_COUNT
"""First of the six rows that limit a backward traction in the same way."""
SIGN_ROWS = BACKWARD_PULL_ROWS + WHEEL_COUNT
"""First of the rows that keep the variables from PEAK on at or above 0."""
ROWS = SIGN_ROWS + VARIABLES - PEAK
"""Number of rows."""

# Weights of the objective, for scaled variables: tractions and peak are of order one.
# 1/2 peak u^2 + 1/2 effort |T|^2 + 1/2 change |(T, s0, s1) - last|^2 + slack * (slacks).
PEAK_WEIGHT = 10.0
"""Weight of the squared peak utilisation. It comes first: 1,000 times the effort."""
EFFORT_WEIGHT = 0.01
"""Weight of the squared tractions: it decides where several sets have the smallest peak."""
CHANGE_WEIGHT = 3.0
"""Weight of the squared change since the last answer; smaller ones take OSQP longer."""
SLACK_PRICE = 100.0
"""Price of a slack: more than a peak can be worth, so that no limit gives way to another."""


@dataclass(frozen=True, eq=False)
class ProgramInputs:
    """Friction and torque that the wheels can count on.

    Raises:
        ModelError: A friction coefficient, the largest torque or the radius is not above 0.
    """

    friction: Floats
    """(6,) friction coefficients."""
    max_torque: float
    """Largest torque of a wheel [N m]."""
    radius: float
    """Wheel radius [m]."""

    def __post_init__(self) -> None:
        """Check all values."""
        if not (self.friction.min() > 0.0 and self.max_torque > 0.0 and self.radius > 0.0):
            raise ModelError(
                f"friction {self.friction.tolist()}, largest torque {self.max_torque} N m and "
                f"wheel radius {self.radius} m must all be above 0"
            )


MIN_LOAD = 0.05
"""Smallest load that a cone is expanded about, in sixths of the weight."""
MIN_PEAK, MAX_PEAK = 0.02, 3.0
"""Smallest and largest utilisation that the cones are expanded about."""
REGULARISATION = 1e-2
"""Curvature of what has no cost of its own: loads and lateral terms."""
SLACK_CURVATURE = 0.1
"""Curvature of a slack, as a share of its price."""


class TractionQP(NamedTuple):
    """Minimise 1/2 y'Py + q'y subject to lower <= A y <= upper."""

    P: Floats
    """(18,) diagonal of the cost's matrix."""
    q: Floats
    """(18,) linear cost."""
    A: Floats
    """(56, 18) rows."""
    lower: Floats
    """(56,) lower bounds."""
    upper: Floats
    """(56,) upper bounds."""
    scale: Floats
    """(18,) x = scale * y + shift in force units, 1 for the peak."""
    shift: Floats
    """(18,) the same."""
    start: Floats
    """(18,) y of the last answer."""


def new_program() -> TractionQP:
    """Return a program of zeros, to be written again and again by `write_program`."""
    sizes = {"A": (ROWS, VARIABLES), "lower": ROWS, "upper": ROWS}
    return TractionQP(*(np.zeros(sizes.get(name, VARIABLES)) for name in TractionQP._fields))


@kernel
def write_program(rows, friction, max_pull, last, last_peak, qp):
    """Write the program for one state of the rover, about the last answer.

    The same entries are written for every state, so that a program can be written over.

    Args:
        rows: BalanceRows at that state, with the wanted net traction.
        friction: (6,) friction coefficients.
        max_pull: Largest traction of a motor in force units.
        last: (14,) forces of the last answer in force units; at first those of equal torques.
        last_peak: Their peak utilisation, or the one to expand about.
        qp: TractionQP, written.
    """
    peak = min(max(last_peak, MIN_PEAK), MAX_PEAK)
    total = 0.0
    for wheel in range(WHEEL_COUNT):
        total += friction[wheel]
    unit = peak * total / WHEEL_COUNT
    _write_units(last, peak, unit, qp)
    _write_costs(qp)
    for row in range(ROWS):
        qp.lower[row], qp.upper[row] = -np.inf, np.inf
    _write_balance_rows(rows, unit, qp)
    for wheel in range(WHEEL_COUNT):
        shares = rows.lateral_shares[wheel, 0], rows.lateral_shares[wheel, 1]
        _write_cone(shares, friction[wheel], last, wheel, qp)
    _write_limit_rows(max_pull, qp)


@kernel
def _write_units(last, peak, unit, qp):
    """Write scale and shift of the variables, and in them the last forces (14,)."""
    for wheel in range(WHEEL_COUNT):
        qp.shift[LOAD + wheel] = max(last[LOAD + wheel], MIN_LOAD)
    for k in range(VARIABLES):
        qp.scale[k] = peak if k in (PEAK, FRICTION_SLACK) else unit
        qp.start[k] = (last[k] - qp.shift[k]) / unit if k < FORCES else 0.0
    qp.start[PEAK] = 1.0


@kernel
def _write_costs(qp):
    """Write the diagonal and the linear part of the cost."""
    P, q, start = qp.P, qp.q, qp.start
    for k in range(VARIABLES):
        P[k], q[k] = REGULARISATION, 0.0
        if k < LOAD or k in (LATERAL_SHARE, LATERAL_SLOPE):
            P[k] = CHANGE_WEIGHT + (EFFORT_WEIGHT if k < LOAD else REGULARISATION)
            q[k] = -CHANGE_WEIGHT * start[k]
        if k >= FRICTION_SLACK:
            P[k], q[k] = SLACK_CURVATURE * SLACK_PRICE, SLACK_PRICE
    P[PEAK] = PEAK_WEIGHT


@kernel
def _write_balance_rows(rows, unit, qp):
    """Write the equations of the balance, divided by `unit`, for shifted loads."""
    for equation in range(EQUATIONS):
        rest = rows.b[equation]
        for k in range(FORCES):
            qp.A[BALANCE_ROWS + equation, k] = rows.A[equation, k]
            rest -= rows.A[equation, k] * qp.shift[k]
        row = BALANCE_ROWS + equation
        qp.lower[row] = qp.upper[row] = rest / unit


@kernel
def _write_cone(shares, friction, last, wheel, qp):
    """Write the tangents of one wheel's cone, one of them where the last forces (14,) point.

    `shares` are those of the wheel in the two lateral terms.
    """
    A, unit, peak, load = qp.A, qp.scale[TRACTION], qp.scale[PEAK], qp.shift[LOAD + wheel]
    lateral = last[LATERAL_SHARE] * shares[0] + last[LATERAL_SLOPE] * shares[1]
    direction = np.arctan2(lateral, last[TRACTION + wheel])
    for side in range(CONE_SIDES):
        row = CONE_ROWS + wheel * CONE_SIDES + side
        angle = direction + 2.0 * np.pi * side / CONE_SIDES
        A[row, TRACTION + wheel] = np.cos(angle)
        A[row, LATERAL_SHARE] = np.sin(angle) * shares[0]
        A[row, LATERAL_SLOPE] = np.sin(angle) * shares[1]
        A[row, LOAD + wheel] = -friction * peak
        A[row, PEAK] = -friction * load * peak / unit
        qp.upper[row] = 0.0


@kernel
def _write_limit_rows(max_pull, qp):
    """Write the limits of peak, loads and tractions with their slacks, and the signs."""
    A, lower, upper, unit = qp.A, qp.lower, qp.upper, qp.scale[TRACTION]
    for wheel in range(WHEEL_COUNT):
        row = LOAD_ROWS + wheel
        A[row, LOAD + wheel] = A[row, LOAD_SLACK] = 1.0
        lower[row] = -qp.shift[LOAD + wheel] / unit
        for row, sign in ((FORWARD_PULL_ROWS + wheel, 1.0), (BACKWARD_PULL_ROWS + wheel, -1.0)):
            A[row, TRACTION + wheel] = sign
            A[row, TORQUE_SLACK] = -1.0
            upper[row] = max_pull / unit
    A[PEAK_LIMIT_ROW, PEAK], A[PEAK_LIMIT_ROW, FRICTION_SLACK] = 1.0, -1.0
    upper[PEAK_LIMIT_ROW] = 1.0 / qp.scale[PEAK]
    for k in range(PEAK, VARIABLES):
        A[SIGN_ROWS + k - PEAK, k] = 1.0
        lower[SIGN_ROWS + k - PEAK] = 0.0
