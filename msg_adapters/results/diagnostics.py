# SPDX-License-Identifier: Apache-2.0
"""Writes states and verdicts as diagnostics for operators, verdicts as JSON for programs."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

VERDICT = "traverse_server: can the rover traverse"
HEALTH, MONITOR, SEARCH = (f"traverse_server: {part}" for part in ("health", "monitor", "search"))
TRACTION = "traction_controller: wheel torques"
SIMULATOR = "rover_simulator: rover"
"""Names of the statuses."""
_LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warning": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
}
ADVICE = {
    "disabled": "disabled: call ~/enable to drive",
    "emergency_stop": "emergency_stop: release it, then call ~/enable",
    "stalled": "stalled: no progress; command zero or the other direction to drive again",
}
"""Messages of states in which the rover rests without a fault."""
WARNED_STATES = ("emergency_stop", "stalled")
"""States of level WARN."""


def make_status(
    name: str, level: str, text: str, values: Mapping[str, Any], hardware_id: str
) -> DiagnosticStatus:
    """Return one status.

    Args:
        name: Its name.
        level: "ok", "warning" or "error".
        text: What is wrong, in words.
        values: Keys and values of the status.
        hardware_id: Name of the rover.
    """
    status = DiagnosticStatus(
        level=_LEVELS[level], name=name, message=text, hardware_id=hardware_id
    )
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return status


def traction_diagnostics(
    values: Mapping[str, Any],
    state: str,
    fault: str,
    warnings: Sequence[str],
    hardware_id: str,
    stamp,
) -> DiagnosticArray:
    """Return the state of a traction controller as one status.

    Args:
        values: Keys and values of the status; `warning`, `fallback` and `contact_source` also
            set its level.
        state: What the controller does, such as driving.
        fault: Reason not to drive, empty if there is no fault.
        warnings: Problems that do not stop the rover.
        hardware_id: Name of the rover.
        stamp: builtin_interfaces/Time.

    Returns:
        An array with one status: ERROR if there is a fault; WARN if the rover is stalled, is
        stopped by the emergency stop, drives with equal torques or lacks an input; else OK.
    """
    problems = [*warnings, *filter(None, [str(values.get("warning", ""))])]
    level = "ok"
    if fault:
        level, text = "error", f"{state}: {fault}"
    elif state in WARNED_STATES:
        level, text = "warning", ADVICE[state]
    elif values.get("fallback"):
        level, text = "warning", "equal torques: not solved"
    elif problems:
        level, text = "warning", f"{state}: {'; '.join(problems)}"
    elif "contact_source" in values:
        text = f"{state}: contact angles from {values['contact_source']}"
    else:
        text = ADVICE.get(state, state)
    entries = {"state": state, **values, "warning": "; ".join(problems)}
    status = make_status(TRACTION, level, text, entries, hardware_id)
    return DiagnosticArray(header=Header(stamp=stamp), status=[status])


def verdict_to_diagnostics(
    level: str,
    reason: str,
    summary: Mapping[str, Any],
    hardware_id: str,
    header: Header,
) -> DiagnosticArray:
    """Write a verdict as one status.

    Args:
        level: "ok", "warning" or "error".
        reason: Why the path is not traversable; empty if it is.
        summary: Each entry becomes a key and a value. Texts are copied, other values are written
            as JSON.
        hardware_id: Name of the rover.
        header: Frame of the map, and stamp.
    """
    entries = {
        key: value if isinstance(value, str) else json.dumps(value)
        for key, value in summary.items()
    }
    status = make_status(VERDICT, level, reason or "traversable", entries, hardware_id)
    return DiagnosticArray(header=header, status=[status])


def to_json(report: Mapping[str, Any]) -> str:
    """Write a report as one line of strict JSON.

    Raises:
        ValueError: An entry is NaN or infinite.
    """
    return json.dumps(report, allow_nan=False)
