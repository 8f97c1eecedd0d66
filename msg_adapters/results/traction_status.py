"""Writes the state of a traction controller as a diagnostic status."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

STATUS_NAME = "traction_controller: wheel torques"


def traction_diagnostics(
    values: Mapping[str, Any], fault: str, hardware_id: str, stamp
) -> DiagnosticArray:
    """Return the state of a traction controller as one status.

    Args:
        values: Keys and values of the status; `warning`, `fallback` and `contact_source` also
            set its level.
        fault: Reason for zero torques, empty if there is no fault.
        hardware_id: Name of the rover.
        stamp: builtin_interfaces/Time.

    Returns:
        An array with one status: ERROR if a fault sets the torques to zero, WARN if the rover
        drives with equal torques or lacks an input, else OK.
    """
    status = DiagnosticStatus(name=STATUS_NAME, hardware_id=hardware_id)
    if fault:
        status.level, status.message = DiagnosticStatus.ERROR, f"zero torque: {fault}"
    elif values.get("fallback"):
        status.level, status.message = DiagnosticStatus.WARN, "equal torques: not solved"
    elif values.get("warning"):
        status.level, status.message = DiagnosticStatus.WARN, str(values["warning"])
    else:
        source = values.get("contact_source", "nothing")
        status.level, status.message = DiagnosticStatus.OK, f"contact angles from {source}"
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message
