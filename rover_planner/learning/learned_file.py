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
    found = asdict(estimate)
    found |= {
        "told_friction": told,
        "mean_is": "the told friction, given the bound"
        if estimate.friction.high is None
        else "measured by wheels that slipped",
        "resistance": {"mean": estimate.resistance, "std": found.pop("resistance_std")},
        "slip_ratios": dict(zip(WHEELS, estimate.slip_ratios, strict=True)),
    }
    del found["soil"]
    if estimate.soil is not None:
        found["soil"] = _describe_soil(estimate.soil)
    contents: dict[str, Any] = to_plain(found)
    return contents


def _describe_soil(soil: SoilEstimate) -> dict[str, Any]:
    pairs = {"sinkage": soil.sinkage, "resistance": soil.resistance, "strength": soil.strength}
    values = {name: {"mean": m, "std": s} for name, (m, s) in (pairs | soil.parameters).items()}
    return values | {"told_apart": soil.told_apart, "cohesion_angle_correlation": soil.trade}
