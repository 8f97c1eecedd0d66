# SPDX-License-Identifier: Apache-2.0
"""Writes the health of a traverse server and the progress of its searches as diagnostics."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

STATUS_NAME = "traverse_server: health"
SEARCH_NAME = "traverse_server: search"

_LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warning": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
}


def server_diagnostics(
    level: str, text: str, values: Mapping[str, Any], hardware_id: str, stamp: Any
) -> DiagnosticArray:
    """Return the health of a traverse server as one status.

    Args:
        level: "ok", "warning" or "error".
        text: What is wrong, in words.
        values: Keys and values of the status.
        hardware_id: Name of the rover.
        stamp: builtin_interfaces/Time.
    """
    return _stamped(make_status(STATUS_NAME, level, text, values, hardware_id), stamp)


def search_diagnostics(
    values: Mapping[str, Any], text: str, hardware_id: str, stamp: Any
) -> DiagnosticArray:
    """Return the progress of a search for a way as one status; arguments as for the health."""
    return _stamped(make_status(SEARCH_NAME, "ok", text, values, hardware_id), stamp)


def make_status(
    name: str, level: str, text: str, values: Mapping[str, Any], hardware_id: str
) -> DiagnosticStatus:
    """Return one status; arguments as for `server_diagnostics`."""
    status = DiagnosticStatus(
        level=_LEVELS[level], name=name, message=text, hardware_id=hardware_id
    )
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return status


def _stamped(status: DiagnosticStatus, stamp: Any) -> DiagnosticArray:
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message
