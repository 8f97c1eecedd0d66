# SPDX-License-Identifier: Apache-2.0
"""Writes the state of a traction controller as a diagnostic status."""

from collections.abc import Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

STATUS_NAME = "traction_controller: wheel torques"
ADVICE = {
    "disabled": "disabled: call ~/enable to drive",
    "emergency_stop": "emergency_stop: release it, then call ~/enable",
    "stalled": "stalled: no progress; command zero or the other direction to drive again",
}
"""Messages of states in which the rover rests without a fault."""
WARNED_STATES = ("emergency_stop", "stalled")
"""States of level WARN."""


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
    status = DiagnosticStatus(name=STATUS_NAME, hardware_id=hardware_id)
    problems = [*warnings, *filter(None, [str(values.get("warning", ""))])]
    if fault:
        status.level, status.message = DiagnosticStatus.ERROR, f"{state}: {fault}"
    elif state in WARNED_STATES:
        status.level, status.message = DiagnosticStatus.WARN, ADVICE[state]
    elif values.get("fallback"):
        status.level, status.message = DiagnosticStatus.WARN, "equal torques: not solved"
    elif problems:
        status.level, status.message = DiagnosticStatus.WARN, f"{state}: {'; '.join(problems)}"
    elif "contact_source" in values:
        status.message = f"{state}: contact angles from {values['contact_source']}"
    else:
        status.message = ADVICE.get(state, state)
    told = {"state": state, **values, "warning": "; ".join(problems)}
    status.values = [KeyValue(key=key, value=str(value)) for key, value in told.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message
