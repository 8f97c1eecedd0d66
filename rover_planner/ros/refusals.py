# SPDX-License-Identifier: Apache-2.0
"""Turns every error of a request into a refusal with a reason, so that the node continues."""

from collections.abc import Callable
from typing import TypeVar

from msg_adapters.errors import MessageError
from rover_physics.errors import RoverError
from rover_planner.errors import PlanningError
from rover_planner.ros.guard import Guard

INPUT_ERRORS = (MessageError, PlanningError, RoverError)
"""Errors of the input; any other error is an internal error."""

Answer = TypeVar("Answer")


def refuse_error(
    guard: Guard, request: str, error: Exception, refuse: Callable[[str, str], Answer]
) -> Answer:
    """Return `refuse(code, reason)` for an error; the guard counts and logs internal errors."""
    if isinstance(error, INPUT_ERRORS):
        return refuse("bad_request", str(error))
    text = guard.report(request, error)
    return refuse("internal_error", f"internal error: {text}")
