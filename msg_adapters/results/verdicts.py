# SPDX-License-Identifier: Apache-2.0
"""Writes verdicts as messages: a diagnostic status for operators, JSON text for programs."""

import json
from collections.abc import Mapping
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

STATUS_NAME = "traverse_server: can the rover traverse"


class Report(Protocol):
    """A report that can be written as JSON."""

    def to_dict(self) -> Mapping[str, Any]:
        """Return all entries in JSON types, without NaN or infinity."""


class PathVerdict(Protocol):
    """A verdict on a path that can be written as a diagnostic status."""

    @property
    def traversable(self) -> bool:
        """Whether the rover may drive the path."""

    @property
    def reason(self) -> str:
        """Reason why the path is not traversable; empty if it is."""

    @property
    def has_warning(self) -> bool:
        """Whether there is a warning for the operator, even if the path is traversable."""

    def summary(self) -> Mapping[str, Any]:
        """Return the short entries in JSON types."""


def report_to_json(report: Report) -> str:
    """Write a report as one line of strict JSON.

    Raises:
        ValueError: An entry is NaN or infinite.
    """
    return json.dumps(report.to_dict(), allow_nan=False)


def verdict_to_diagnostics(
    verdict: PathVerdict, hardware_id: str, frame_id: str, stamp: Any
) -> DiagnosticArray:
    """Write a verdict as one diagnostic status.

    Args:
        verdict: Each entry of its summary becomes a key and a value. Texts are copied, other
            values are written as JSON.
        hardware_id: Name of the rover.
        frame_id: Map frame.
        stamp: builtin_interfaces/Time.

    Returns:
        An array with one status: OK if traversable, WARN if traversable with a warning, else
        ERROR with the reason as its message.
    """
    level = DiagnosticStatus.WARN if verdict.has_warning else DiagnosticStatus.OK
    status = DiagnosticStatus(
        level=level if verdict.traversable else DiagnosticStatus.ERROR,
        name=STATUS_NAME,
        message=verdict.reason or "traversable",
        hardware_id=hardware_id,
    )
    status.values = [
        KeyValue(key=key, value=value if isinstance(value, str) else json.dumps(value))
        for key, value in verdict.summary().items()
    ]
    message = DiagnosticArray(status=[status])
    message.header.frame_id = frame_id
    message.header.stamp = stamp
    return message
