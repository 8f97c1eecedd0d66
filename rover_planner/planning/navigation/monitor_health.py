# SPDX-License-Identifier: Apache-2.0
"""What a monitor has found, for diagnostics."""

from typing import Any

from rover_planner.planning.answering.server_health import ERROR, OK, WARN, Health
from rover_planner.planning.navigation.monitor import IDLE, STOPPED, Finding


def describe_watch(finding: Finding, enabled: bool, tolerance: float) -> Health:
    """Return level, text and values of a finding.

    Args:
        finding: What was found last.
        enabled: Whether accepted paths are watched.
        tolerance: Difference of measured and predicted suspension angles [rad] that is no warning.
    """
    values = {"monitor": enabled, **_values_of(finding)}
    drifts = finding.drift > tolerance
    drift = (
        f"measured and predicted suspension differ by {finding.drift:.3f} rad, "
        f"tolerance {tolerance:.3f} rad"
    )
    if enabled and finding.state == STOPPED and finding.judgement is not None:
        return Health(
            ERROR, f"stop ({finding.judgement.code}): {finding.judgement.reason}", values
        )
    if drifts:
        return Health(WARN, drift, values)
    if not enabled:
        return Health(OK, "no path is watched: the parameter monitor is false", values)
    return Health(OK, "no path to watch" if finding.state == IDLE else finding.state, values)


def _values_of(finding: Finding) -> dict[str, Any]:
    place = finding.place
    values: dict[str, Any] = {"state": finding.state, "path_hash": finding.path_hash}
    values["judgements"] = finding.judged
    if place is not None:
        values["remaining"] = f"{place.remaining:.3f} m"
        values["offset"] = f"{place.offset:.3f} m"
    if finding.mismatch:
        values["suspension_drift"] = f"{finding.drift:.4f} rad"
    for joint, difference in finding.mismatch.items():
        values[f"mismatch {joint}"] = f"{difference:+.4f} rad"
    return values
