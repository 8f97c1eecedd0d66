# SPDX-License-Identifier: Apache-2.0
"""The file of what was learned of the ground, as `learn` writes it."""

from dataclasses import asdict
from typing import Any

from rover_physics.names import WHEELS
from rover_physics.numerics.plain_values import to_plain
from rover_planner.learning.ground_learner import GroundEstimate
from rover_planner.learning.soil_fit import SoilEstimate


def describe(estimate: GroundEstimate, told: float) -> dict[str, Any]:
    """Return an estimate as the contents of a file of JSON.

    Args:
        estimate: The estimate.
        told: Friction that was assumed before anything was measured.
    """
    found: dict[str, Any] = {
        "friction": asdict(estimate.friction),
        "slip_time": estimate.slip_time,
        "immobilised_time": estimate.immobilised_time,
        "sides": {side: asdict(one) for side, one in estimate.sides.items()},
        "classes": {number: asdict(one) for number, one in estimate.classes.items()},
        "told_friction": told,
        "mean_is": "the told friction, given the bound"
        if estimate.friction.high is None
        else "measured by wheels that slipped",
        "resistance": {"mean": estimate.resistance, "std": estimate.resistance_std},
        "slip_ratios": dict(zip(WHEELS, estimate.slip_ratios, strict=True)),
        "side_slip": estimate.side_slip,
        "time": estimate.time,
        "stuck": estimate.stuck,
        "faults": estimate.faults,
    }
    if estimate.soil is not None:
        found["soil"] = _describe_soil(estimate.soil)
    contents: dict[str, Any] = to_plain(found)
    return contents


def _describe_soil(soil: SoilEstimate) -> dict[str, Any]:
    pairs = {"sinkage": soil.sinkage, "resistance": soil.resistance, "strength": soil.strength}
    values = {name: {"mean": m, "std": s} for name, (m, s) in (pairs | soil.parameters).items()}
    return values | {"told_apart": soil.told_apart, "cohesion_angle_correlation": soil.trade}
