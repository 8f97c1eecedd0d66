"""The state of a traction controller as a diagnostic status."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

STATUS_NAME = "traction_controller: wheel torques"


def traction_diagnostics(
    words: Mapping[str, Any], fault: str, hardware_id: str, stamp
) -> DiagnosticArray:
    """Write what there is to say of a traction controller as one status.

    Args:
        words: What becomes keys and values; `warning`, `fallback` and `contact_source` decide the
            level too.
        fault: Why there is no torque, empty where there is.
        hardware_id: Name of the rover.
        stamp: builtin_interfaces/Time.

    Returns:
        An array with one status: ERROR where a fault holds the wheels, WARN where the rover
        drives on less than it should have, else OK.
    """
    status = DiagnosticStatus(name=STATUS_NAME, hardware_id=hardware_id)
    if fault:
        status.level, status.message = DiagnosticStatus.ERROR, f"zero torque: {fault}"
    elif words.get("fallback"):
        status.level, status.message = DiagnosticStatus.WARN, "equal torques: not solved"
    elif words.get("warning"):
        status.level, status.message = DiagnosticStatus.WARN, str(words["warning"])
    else:
        source = words.get("contact_source", "nothing")
        status.level, status.message = DiagnosticStatus.OK, f"contact angles from {source}"
    status.values = [KeyValue(key=key, value=str(value)) for key, value in words.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message
