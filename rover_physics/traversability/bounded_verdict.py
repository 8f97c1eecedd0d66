# SPDX-License-Identifier: Apache-2.0
"""Refusals that follow from the worst case within the bounds of an uncertain map."""

from dataclasses import replace
from typing import Any

import numpy as np

from rover_physics.bounds.path import BOUNDED_VALUES
from rover_physics.limits.table import NOT_COMPUTABLE
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_bounds import PathBounds
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.status import BoundStatus
from rover_physics.traversability.verdict import (
    BOUNDS,
    EXEMPT_ON_EDGE,
    Verdict,
    explain_rows,
    find_largest_risk,
    with_refusals,
)

_UNBOUNDED = {
    BoundStatus.ON_EDGE: ("not_settled", "a wheel may climb or fall off an edge"),
    BoundStatus.UNKNOWN_NEAR: ("unknown_ground", "a wheel may reach unknown ground"),
    BoundStatus.OFF_MAP_NEAR: ("off_map", "a wheel may leave the map"),
    BoundStatus.SINGULAR: ("no_equilibrium", "the wheel loads may not be determined"),
}


def refuse_worst_case(
    rover: Rover, prediction: PathPrediction, bounds: PathBounds, verdict: Verdict
) -> Verdict:
    """Add the refusals of the bounds to a verdict; its own refusals remain.

    Args:
        rover: The rover, with its limits.
        prediction: The prediction that was bounded.
        bounds: Its bounds.
        verdict: The verdict on the prediction itself.

    Returns:
        The verdict with the additional refusals and the extremes of the bounds. An additional
        reason contains "at worst" or "within ... sigma of the map".
    """
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    within = f"within {bounds.sigmas:g} sigma of the map"
    worst, risk = _find_worst(rover, prediction, bounds)
    for i, (code, reason) in worst.items():
        if not codes[i]:
            codes[i], reasons[i] = code, f"{reason}, at worst {within}"
    for i, status in enumerate(bounds.status.tolist()):
        if not codes[i] and status in _UNBOUNDED:
            codes[i], what = _UNBOUNDED[status]
            reasons[i] = f"{what} {within}"
    rolling_off_edge = np.asarray(prediction.falling.any(axis=1))
    needed = bounds.bounded & ~rolling_off_edge
    for name in BOUNDED_VALUES:
        # Where the value itself is not known, as the clearance over unknown ground, no bound is.
        missing = np.isnan(getattr(bounds, name)).any(axis=-1) & ~np.isnan(
            getattr(prediction, name)
        )
        for i in np.flatnonzero(needed & missing.reshape(len(needed), -1).any(axis=1)).tolist():
            if not codes[i]:
                codes[i] = NOT_COMPUTABLE
                reasons[i] = f"{name} cannot be computed {within}: a bound is not a number"
    extremes: dict[str, Any] = {}
    for name, worse in BOUNDS.items():
        quantity, end = name.removesuffix("_bound"), 0 if worse is np.fmin else 1
        rows = needed if quantity in EXEMPT_ON_EDGE else bounds.bounded
        values = getattr(bounds, quantity)[rows][..., end]
        extremes[name] = float(worse.reduce(values, axis=None)) if values.size else np.nan
    refused = with_refusals(verdict, codes, reasons)
    risk = max(verdict.risk, risk)
    return replace(refused, risk=risk, map_sigmas=bounds.sigmas, **extremes)


def _find_worst(
    rover: Rover, prediction: PathPrediction, bounds: PathBounds
) -> tuple[dict[int, tuple[str, str]], float]:
    """Return code and reason of the rows that break a limit in the worst case, and their risk."""

    def at(end: int, *names: str) -> dict[str, Floats]:
        found = {}
        for name in names:
            values = getattr(bounds, name)[..., end]
            found[name] = np.where(np.isnan(values), getattr(prediction, name), values)
        return found

    joints = "rocker_angle", "bogie_angle"
    worst = prediction.change(
        roll=_largest(prediction.roll, bounds.roll),
        pitch=_largest(prediction.pitch, bounds.pitch),
        **at(0, *joints, "belly_clearance", "tip_over_ratio", "wheel_loads"),
        **at(1, "friction_utilisation", "torque_saturation", "sinkage"),
    )
    limits, found, risk = limits_of(rover, prediction.policy), dict[int, tuple[str, str]](), 0.0
    for part in (worst, worst.change(**at(1, *joints))):
        uses = find_uses(limits, part.results)
        for row, refusal in explain_rows(rover, part, uses).items():
            if row not in found or refusal[0] == "suspension":
                found[row] = refusal
        risk = max(risk, find_largest_risk(uses, part.settled))
    return found, risk


def _largest(value: Floats, bounds: Floats) -> Floats:
    """Return the end of each interval (n, 2) farther from 0; the value (n,) where it is NaN."""
    rows = np.arange(len(bounds))
    farther = bounds[rows, np.argmax(np.abs(bounds), axis=1)]
    return np.where(np.isnan(farther), value, farther)
