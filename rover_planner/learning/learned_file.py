# SPDX-License-Identifier: Apache-2.0
"""The file of what was learned of the ground: written by `learn`, taken by `predict`."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of, show_file
from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.learning.ground_learner import GroundEstimate

MOST_SPREAD = 0.35
"""Largest relative standard deviation of friction that a rover file takes."""


def describe(estimate: GroundEstimate, told: float) -> dict[str, Any]:
    """Return an estimate as the contents of a file of JSON.

    Args:
        estimate: The estimate.
        told: Friction that was assumed before anything was measured.
    """
    ratios = estimate.slip_ratios
    return {
        "friction": asdict(estimate.friction),
        "slip_time": estimate.slip_time,
        "immobilised_time": estimate.immobilised_time,
        "sides": {side: asdict(one) for side, one in estimate.sides.items()},
        "told_friction": told,
        "mean_is": "the told friction, given the bound"
        if estimate.friction.high is None
        else "measured by wheels that slipped",
        "resistance": {"mean": estimate.resistance, "std": _finite(estimate.resistance_std)},
        "slip_ratios": {
            name: _finite(value) for name, value in zip(WHEELS, ratios.tolist(), strict=True)
        },
        "side_slip": estimate.side_slip,
        "time": _finite(estimate.time),
        "faults": estimate.faults,
    }


def write_learned(path: Path, contents: dict[str, Any]) -> None:
    """Write a file of JSON.

    Raises:
        PlanningError: It cannot be written.
    """
    try:
        with errors_of(path):
            write_file(path, (json.dumps(contents, indent=1) + "\n").encode())
    except RoverFileError as error:
        raise PlanningError(str(error)) from None


def rover_on_learned_ground(rover: Rover, path: Path) -> Rover:
    """Return a rover with the friction of a file, and with the uncertainty of it for chances.

    Raises:
        PlanningError: The file cannot be read or is none of `learn`.
    """
    try:
        friction = json.loads(path.read_text(encoding="utf-8"))["friction"]
        mean, std = float(friction["mean"]), float(friction["std"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise PlanningError(
            f"{show_file(path)}: is no file of learn, with friction: mean, std: {error}"
        ) from None
    if not (np.isfinite([mean, std]).all() and mean > 0.0 <= std):
        raise PlanningError(f"{show_file(path)}: friction must have a mean above 0 and a std")
    spread = min(std / mean, MOST_SPREAD)
    return replace(rover, friction=mean, uncertainty=replace(rover.uncertainty, friction=spread))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
