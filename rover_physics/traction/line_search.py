# SPDX-License-Identifier: Apache-2.0
"""The peak utilisation of shared forces by the round cone, and its search along a line."""

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.traction.balance import BalanceRows
from rover_physics.traction.layout import FORCES, LATERAL_SHARE, LATERAL_SLOPE, LOAD, TRACTION
from rover_physics.traction.program import (
    EFFORT_WEIGHT,
    MIN_LOAD,
    MIN_PEAK,
    PEAK_WEIGHT,
    SLACK_PRICE,
    ProgramInputs,
    Reference,
    max_pull_of,
)

LINE_END = 1.5
"""Where the search ends; 0 is at the last forces and 1 at the answer of a program."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""The golden section."""
SECTIONS = 10
"""Sections of the search; they find the best place to within 1 % of the line."""
ROUNDING = 1e-4
"""Share of the largest pull by which OSQP may exceed it."""


def measure_peak(rows: BalanceRows, inputs: ProgramInputs, x: np.ndarray) -> float:
    """Return the largest sqrt(T^2 + S^2) / (mu N) of x (14,), with loads of MIN_LOAD at least."""
    return _measure_first_peak(rows.packed, inputs.packed, x)


def find_best_between(
    rows: BalanceRows, inputs: ProgramInputs, reference: Reference, aim: np.ndarray
) -> tuple[Reference, float]:
    """Find the forces of the smallest cost on the line through two sets of forces.

    A program knows cones as they are about its reference; far from it they may be wrong, and a
    sequence of answers may oscillate. Where its answer has a smaller peak than the reference,
    peaks fall from the reference on, so that the best place on the line never has a larger one.
    The balance is linear: all on the line keep it where both ends do.

    Args:
        rows: The balance.
        inputs: Friction and torque of the wheels.
        reference: The last forces; its peak is not used.
        aim: (14,) the answer of a program, in force units.

    Returns:
        The forces with their peak utilisation, and how far the tractions moved, in force units.
    """
    found = np.empty(FORCES)
    peak, moved = _search(rows.packed, inputs.packed, reference.x, aim, found)
    return Reference(found, peak), moved


@kernel
def _measure_first_peak(balances, all_inputs, x):
    """Return the peak utilisation of forces x (14,)."""
    return _measure_peak(balances[0], all_inputs[0], x)


@kernel
def _measure_peak(balance, inputs, x):
    """Return the peak utilisation of forces x (14,)."""
    shares, friction = balance.lateral_shares, inputs.friction
    peak = 0.0
    for wheel in range(WHEEL_COUNT):
        lateral = x[LATERAL_SHARE] * shares[wheel, 0] + x[LATERAL_SLOPE] * shares[wheel, 1]
        across = np.sqrt(x[TRACTION + wheel] * x[TRACTION + wheel] + lateral * lateral)
        peak = max(peak, across / (friction[wheel] * max(x[LOAD + wheel], MIN_LOAD)))
    return peak


@kernel
def _search(balances, all_inputs, start, aim, x):
    """Write the best forces by golden section; return their peak and how far tractions moved."""
    balance, inputs = balances[0], all_inputs[0]
    points, units = (start, aim, x), _find_units(balance, inputs, start)
    low, high = 0.0, LINE_END
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    cost_a = _cost_at(a, balance, inputs, points, units)
    cost_b = _cost_at(b, balance, inputs, points, units)
    for _ in range(SECTIONS):
        if cost_a <= cost_b:
            high, b, cost_b = b, a, cost_a
            a = high - GOLDEN * (high - low)
            cost_a = _cost_at(a, balance, inputs, points, units)
        else:
            low, a, cost_a = a, b, cost_b
            b = low + GOLDEN * (high - low)
            cost_b = _cost_at(b, balance, inputs, points, units)
    place, least = 0.5 * (low + high), np.inf
    for candidate in (0.0, place, 1.0):
        cost = _cost_at(candidate, balance, inputs, points, units)
        if cost <= least:
            place, least = candidate, cost
    _cost_at(place, balance, inputs, points, units)
    moved = 0.0
    for k in range(TRACTION, TRACTION + WHEEL_COUNT):
        moved = max(moved, abs(x[k] - start[k]))
    return _measure_peak(balance, inputs, x), moved


@kernel
def _find_units(balance, inputs, start):
    """Return the largest pull in force units, and what the program divides by about `start`.

    Those are the unit of peaks, and that of tractions in force units.
    """
    mean_friction = 0.0
    for wheel in range(WHEEL_COUNT):
        mean_friction += inputs.friction[wheel] / WHEEL_COUNT
    peak_unit = max(_measure_peak(balance, inputs, start), MIN_PEAK)
    return max_pull_of(inputs, balance.force_unit), peak_unit, peak_unit * mean_friction


@kernel
def _cost_at(place, balance, inputs, points, units):
    """Write the forces at a place on the line, and return what the program minimises.

    `points` are start, aim and the forces to write (14,) each; `units` are those of `_find_units`.
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
    peak = _measure_peak(balance, inputs, x) / peak_unit
    cost = 0.5 * (PEAK_WEIGHT * peak * peak + EFFORT_WEIGHT * squares / (unit * unit))
    return cost + SLACK_PRICE * (max(peak - 1.0 / peak_unit, 0.0) + (pull + lift) / unit)
