# SPDX-License-Identifier: Apache-2.0
"""Compares measured suspension angles with those predicted where the rover stands."""

from collections.abc import Mapping

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.results.path_prediction import PathPrediction
from rover_planner.planning.verdict_report import SuspensionReport


def compare_suspension(
    prediction: PathPrediction, measured: Mapping[str, float], tolerance: float
) -> SuspensionReport | None:
    """Compare measured and predicted suspension angles.

    Args:
        prediction: Prediction of the rover where it stands, the first waypoint.
        measured: Joint angles [rad] by name; joints outside the suspension are ignored.
        tolerance: Largest difference that counts as agreement [rad].

    Returns:
        The comparison; None if nothing was measured or the first waypoint did not settle.
    """
    if not (measured and prediction.settled[0]):
        return None
    predicted = (*prediction.rocker_angle[0].tolist(), *prediction.bogie_angle[0].tolist())
    mismatch = {
        name: measured[name] - angle
        for name, angle in zip(SUSPENSION_JOINTS, predicted, strict=True)
        if name in measured
    }
    if not mismatch:
        return None
    agrees = max(abs(difference) for difference in mismatch.values()) <= tolerance
    return SuspensionReport(mismatch, agrees)
