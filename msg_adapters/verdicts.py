"""Verdicts as messages: a diagnostic status for the operator, JSON text for programs."""

import json
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from rover_physics.numerics.plain_values import to_plain

STATUS_NAME = "traverse_server: can the rover traverse"
PER_WAYPOINT = (
    "reasons",
    "codes",
    "traversability_classes",
    "class_constraints",
    "class_wheels",
    "class_margins",
)
"""Entries of a verdict with a value for each waypoint; only in JSON."""


FIRST = ("traversable", "code", "reason")
"""Entries that open the JSON."""


def verdict_to_json(verdict: Mapping[str, Any]) -> str:
    """Write a verdict as one line of strict JSON; what is not a finite number becomes null.

    The FIRST entries come first and the PER_WAYPOINT ones, which are long, last.
    """
    short = [key for key in verdict if key not in FIRST + PER_WAYPOINT]
    order = [key for key in (*FIRST, *short, *PER_WAYPOINT) if key in verdict]
    return json.dumps(to_plain({key: verdict[key] for key in order}), allow_nan=False)


def verdict_to_diagnostics(
    verdict: Mapping[str, Any],
    hardware_id: str,
    frame_id: str,
    stamp,
    warn: bool = False,
) -> DiagnosticArray:
    """Write a verdict as one diagnostic status.

    Args:
        verdict: At least `traversable` and `reason`; every entry becomes a key and a value, a
            nested one as JSON, but for the PER_WAYPOINT ones, which are too long to read.
        hardware_id: Name of the rover.
        frame_id: Map frame.
        stamp: builtin_interfaces/Time.
        warn: A traversable path is reported as WARN, where something needs a look.

    Returns:
        An array with one status: OK (or WARN) where traversable, else ERROR with the reason.
    """
    level = DiagnosticStatus.WARN if warn else DiagnosticStatus.OK
    status = DiagnosticStatus(
        level=level if verdict["traversable"] else DiagnosticStatus.ERROR,
        name=STATUS_NAME,
        message=verdict["reason"] or "traversable",
        hardware_id=hardware_id,
    )
    to_tell = {key: value for key, value in verdict.items() if key not in PER_WAYPOINT}
    status.values = [
        KeyValue(key=key, value=value if isinstance(value, str) else json.dumps(value))
        for key, value in to_plain(to_tell).items()
    ]
    message = DiagnosticArray(status=[status])
    message.header.frame_id = frame_id
    message.header.stamp = stamp
    return message
