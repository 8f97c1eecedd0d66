# SPDX-License-Identifier: Apache-2.0
"""Checks the address of a page before it is served."""

import socket

from rover_physics.files.validation import describe
from rover_planner.errors import PlanningError

MAX_PORT = 65535


def check_address(host: str, port: int) -> None:
    """Check that this machine can serve on an address; the port itself may be taken.

    viser would search in vain for a free port, or wait for ever.

    Args:
        host: Name or address.
        port: Port; 0 for any free one.

    Raises:
        PlanningError: The port is out of range, or the host is no address of this machine.
    """
    if not 0 <= port <= MAX_PORT:
        raise PlanningError(f"port is {describe(port)}; it must be 0 to {MAX_PORT}")
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, kind, protocol, _, address = found[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.bind(address)
    except (OSError, UnicodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise PlanningError(
            f"host is {host!r}; it must be an address of this machine, such as 127.0.0.1 or "
            f"0.0.0.0 ({reason})"
        ) from error
