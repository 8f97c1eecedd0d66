"""How good shared forces are, by the round cone, and the best ones on the way to an answer."""

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.traction.balance import FORCES, WHEEL_COUNT, BalanceRows
from rover_physics.traction.program import MIN_LOAD, MIN_PEAK, TractionWeights

REACH = 1.5
"""How far the search goes, in ways from the last forces to the answer of a program."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
SECTIONS = 10
"""Sections of the search; they tell the place to within 1 % of the way."""
ROUNDING = 1e-4
"""Share of the largest pull by which OSQP may be beyond it."""


def measure_utilisation(rows: BalanceRows, friction: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return sqrt(T^2 + S^2) / (mu N) (6,) of x (14,), with loads of MIN_LOAD at least."""
    across = np.hypot(x[:6], x[12] + x[13] * rows.along)
    return across / (friction * np.maximum(x[6:12], MIN_LOAD))


def measure_peak(rows: BalanceRows, friction: np.ndarray, x: np.ndarray) -> float:
    """Return the largest of `measure_utilisation`."""
    return _measure_peak(rows.along, friction, x)


def find_best_between(
    rows: BalanceRows,
    friction: np.ndarray,
    most_pull: float,
    weights: TractionWeights,
    start: np.ndarray,
    aim: np.ndarray,
) -> tuple[np.ndarray, float, float]:
    """Look on the line through two sets of forces for the one with the smallest cost.

    A program knows cones as they are about its reference; far from it they may be wrong, and a
    sequence of answers may go to and fro. Where its answer has a smaller peak than the reference,
    peaks fall from the reference on, so that the best place on the way never has a larger one.
    The balance is linear: all on the line keep it where both ends do.

    Args:
        rows: The balance.
        friction: (6,) friction coefficients.
        most_pull: Largest torque over the wheel radius, in force units.
        weights: What the program weighs; here of the exact peak.
        start: (14,) the reference, in force units.
        aim: (14,) the answer, in force units.

    Returns:
        The forces (14,), their peak utilisation, and how far the tractions moved.
    """
    found = np.empty(FORCES)
    peak, moved = _search(
        rows.along, friction, most_pull, weights.peak, weights.effort, weights.slack,
        start, aim, found,
    )  # fmt: skip
    return found, peak, moved


@kernel
def _measure_peak(along, friction, x):
    peak = 0.0
    for wheel in range(WHEEL_COUNT):
        lateral = x[12] + x[13] * along[wheel]
        across = np.sqrt(x[wheel] * x[wheel] + lateral * lateral)
        peak = max(peak, across / (friction[wheel] * max(x[6 + wheel], MIN_LOAD)))
    return peak


@kernel
def _search(along, friction, most_pull, by_peak, effort, slack, start, aim, x):
    """Write the best forces by golden section; return their peak and how far tractions moved."""
    unit, mean = max(_measure_peak(along, friction, start), MIN_PEAK), 0.0
    for wheel in range(WHEEL_COUNT):
        mean += friction[wheel] / WHEEL_COUNT
    scales = (by_peak, effort, slack, unit, unit * mean)
    low, high = 0.0, REACH
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    cost_a = _cost_at(a, along, friction, most_pull, scales, start, aim, x)
    cost_b = _cost_at(b, along, friction, most_pull, scales, start, aim, x)
    for _ in range(SECTIONS):
        if cost_a <= cost_b:
            high, b, cost_b = b, a, cost_a
            a = high - GOLDEN * (high - low)
            cost_a = _cost_at(a, along, friction, most_pull, scales, start, aim, x)
        else:
            low, a, cost_a = a, b, cost_b
            b = low + GOLDEN * (high - low)
            cost_b = _cost_at(b, along, friction, most_pull, scales, start, aim, x)
    place, least = 0.5 * (low + high), np.inf
    for candidate in (0.0, place, 1.0):
        cost = _cost_at(candidate, along, friction, most_pull, scales, start, aim, x)
        if cost <= least:
            place, least = candidate, cost
    _cost_at(place, along, friction, most_pull, scales, start, aim, x)
    moved = 0.0
    for wheel in range(WHEEL_COUNT):
        moved = max(moved, abs(x[wheel] - start[wheel]))
    return _measure_peak(along, friction, x), moved


@kernel
def _cost_at(place, along, friction, most_pull, scales, start, aim, x):
    """Write the forces at a place on the line, and return what the program minimises."""
    by_peak, effort, slack, unit, force_unit = scales
    squares = pull = lift = 0.0
    for k in range(FORCES):
        x[k] = start[k] + place * (aim[k] - start[k])
    for wheel in range(WHEEL_COUNT):
        squares += x[wheel] * x[wheel]
        pull = max(pull, abs(x[wheel]) - (1.0 + ROUNDING) * most_pull)
        lift = max(lift, -x[6 + wheel])
    peak = _measure_peak(along, friction, x) / unit
    cost = 0.5 * (by_peak * peak * peak + effort * squares / (force_unit * force_unit))
    return cost + slack * (max(peak - 1.0 / unit, 0.0) + (pull + lift) / force_unit)


@kernel
def write_forces(along, friction, unit, radius, most, x, table):
    """Write torques, loads, tractions, lateral forces and utilisations (5, 6) in SI units.

    Torques are cut off at `most`; utilisations are infinite where there is no load.

    Returns:
        Largest utilisation, least load, largest traction.
    """
    peak, least, pull = 0.0, np.inf, 0.0
    for wheel in range(WHEEL_COUNT):
        traction, load = unit * x[wheel], unit * x[6 + wheel]
        lateral = unit * (x[12] + x[13] * along[wheel])
        across = np.sqrt(traction * traction + lateral * lateral)
        table[0, wheel] = min(max(radius * traction, -most), most)
        table[1, wheel], table[2, wheel], table[3, wheel] = load, traction, lateral
        table[4, wheel] = across / (friction[wheel] * load) if load > 0.0 else np.inf
        peak, least = max(peak, table[4, wheel]), min(least, load)
        pull = max(pull, abs(traction))
    return peak, least, pull
