"""How good shared forces are, by the round cone, and the best ones on the way to an answer."""

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.traction.balance import BalanceRows
from rover_physics.traction.layout import (
    FORCES,
    LATERAL_SHARE,
    LATERAL_SLOPE,
    LOAD,
    LOADS,
    TRACTION,
    TRACTIONS,
)
from rover_physics.traction.program import MIN_LOAD, MIN_PEAK, Reference, TractionWeights
from rover_physics.traction.wheel_limits import WheelLimits, max_pull_of

LINE_END = 1.5
"""Where the search ends; 0 is at the last forces and 1 at the answer of a program."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""The golden section."""
SECTIONS = 10
"""Sections of the search; they find the best place to within 1 % of the way."""
ROUNDING = 1e-4
"""Share of the largest pull by which OSQP may exceed it."""


def measure_utilisation(rows: BalanceRows, limits: WheelLimits, x: np.ndarray) -> np.ndarray:
    """Return sqrt(T^2 + S^2) / (mu N) (6,) of x (14,), with loads of MIN_LOAD at least."""
    across = np.hypot(x[TRACTIONS], x[LATERAL_SHARE] + x[LATERAL_SLOPE] * rows.along)
    return across / (limits.friction * np.maximum(x[LOADS], MIN_LOAD))


def measure_peak(rows: BalanceRows, limits: WheelLimits, x: np.ndarray) -> float:
    """Return the largest of `measure_utilisation`."""
    return _measure_first_peak(rows.packed, limits.packed, x)


LINE = record_type(
    ("start", float, (FORCES,)),  # the last forces, in force units
    ("aim", float, (FORCES,)),  # the answer of a program, in force units
    ("x", float, (FORCES,)),  # the forces at the place that was looked at last
    ("max_pull", float),  # largest pull of a motor, in force units
    ("peak_unit", float),  # what the program divides peaks by
    ("traction_unit", float),  # what the program divides tractions by
)
"""A line through two sets of forces, and the units of the program along it."""


def find_best_between(
    rows: BalanceRows,
    limits: WheelLimits,
    weights: TractionWeights,
    reference: Reference,
    aim: np.ndarray,
) -> tuple[Reference, float]:
    """Find the forces of the smallest cost on the line through two sets of forces.

    A program knows cones as they are about its reference; far from it they may be wrong, and a
    sequence of answers may oscillate. Where its answer has a smaller peak than the reference,
    peaks fall from the reference on, so that the best place on the way never has a larger one.
    The balance is linear: all on the line keep it where both ends do.

    Args:
        rows: The balance.
        limits: Friction and torque of the wheels.
        weights: Weights of the program; here the peak is the exact one.
        reference: The last forces; its peak is not used.
        aim: (14,) the answer of a program, in force units.

    Returns:
        The forces with their peak utilisation, and how far the tractions moved, in force units.
    """
    line = np.zeros(1, LINE)
    line["start"], line["aim"] = reference.x, aim
    peak, moved = _search(rows.packed, limits.packed, weights.packed, line)
    return Reference(line["x"][0], peak), moved


@kernel
def _measure_first_peak(balances, all_limits, x):
    """Return the peak utilisation of forces x (14,)."""
    return _measure_peak(balances[0], all_limits[0], x)


@kernel
def _measure_peak(balance, limits, x):
    """Return the peak utilisation of forces x (14,)."""
    along, friction = balance.along, limits.friction
    peak = 0.0
    for wheel in range(WHEEL_COUNT):
        lateral = x[LATERAL_SHARE] + x[LATERAL_SLOPE] * along[wheel]
        across = np.sqrt(x[TRACTION + wheel] * x[TRACTION + wheel] + lateral * lateral)
        peak = max(peak, across / (friction[wheel] * max(x[LOAD + wheel], MIN_LOAD)))
    return peak


@kernel
def _search(balances, all_limits, all_weights, lines):
    """Write the best forces by golden section; return their peak and how far tractions moved."""
    balance, limits, weights, line = balances[0], all_limits[0], all_weights[0], lines[0]
    _write_line_units(balance, limits, line)
    low, high = 0.0, LINE_END
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    cost_a = _cost_at(a, balance, limits, weights, line)
    cost_b = _cost_at(b, balance, limits, weights, line)
    for _ in range(SECTIONS):
        if cost_a <= cost_b:
            high, b, cost_b = b, a, cost_a
            a = high - GOLDEN * (high - low)
            cost_a = _cost_at(a, balance, limits, weights, line)
        else:
            low, a, cost_a = a, b, cost_b
            b = low + GOLDEN * (high - low)
            cost_b = _cost_at(b, balance, limits, weights, line)
    place, least = 0.5 * (low + high), np.inf
    for candidate in (0.0, place, 1.0):
        cost = _cost_at(candidate, balance, limits, weights, line)
        if cost <= least:
            place, least = candidate, cost
    _cost_at(place, balance, limits, weights, line)
    moved = 0.0
    for k in range(TRACTION, TRACTION + WHEEL_COUNT):
        moved = max(moved, abs(line.x[k] - line.start[k]))
    return _measure_peak(balance, limits, line.x), moved


@kernel
def _write_line_units(balance, limits, line):
    """Write the units of the program about the start of a line."""
    mean_friction = 0.0
    for wheel in range(WHEEL_COUNT):
        mean_friction += limits.friction[wheel] / WHEEL_COUNT
    line.max_pull = max_pull_of(limits, balance.force_unit)
    line.peak_unit = max(_measure_peak(balance, limits, line.start), MIN_PEAK)
    line.traction_unit = line.peak_unit * mean_friction


@kernel
def _cost_at(place, balance, limits, weights, line):
    """Write the forces at a place on the line, and return what the program minimises."""
    x, start, aim = line.x, line.start, line.aim
    squares = pull = lift = 0.0
    for k in range(FORCES):
        x[k] = start[k] + place * (aim[k] - start[k])
    for wheel in range(WHEEL_COUNT):
        traction = x[TRACTION + wheel]
        squares += traction * traction
        pull = max(pull, abs(traction) - (1.0 + ROUNDING) * line.max_pull)
        lift = max(lift, -x[LOAD + wheel])
    peak, unit = _measure_peak(balance, limits, x) / line.peak_unit, line.traction_unit
    cost = 0.5 * (weights.peak * peak * peak + weights.effort * squares / (unit * unit))
    return cost + weights.slack * (max(peak - 1.0 / line.peak_unit, 0.0) + (pull + lift) / unit)
