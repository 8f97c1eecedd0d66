# SPDX-License-Identifier: Apache-2.0
"""Writes states and verdicts as diagnostics for operators, verdicts as JSON for programs."""

import json
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

VERDICT = "traverse_server: can the rover traverse"
HEALTH, MONITOR, SEARCH = (f"traverse_server: {part}" for part in ("health", "monitor", "search"))
TORQUES = "traction_controller: wheel torques"
SIMULATOR = "rover_simulator: rover"
"""Names of the statuses."""
_LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warning": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
}


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


def texts_of(values: Mapping[str, Any]) -> dict[str, str]:
    """Return values of a status with texts as they are and all else as JSON."""
    return {
        key: value if isinstance(value, str) else json.dumps(value)
        for key, value in values.items()
    }


def to_json(report: Mapping[str, Any]) -> str:
    """Write a report as one line of strict JSON.

    Raises:
        ValueError: An entry is NaN or infinite.
    """
    return json.dumps(report, allow_nan=False)
