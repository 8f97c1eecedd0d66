"""Turns every error of a request into a refusal with a reason, so that the node continues."""

import traceback
from collections.abc import Callable
from typing import TypeVar

from msg_adapters.errors import MessageError
from rover_physics.errors import RoverError
from rover_planner.errors import PlanningError

INPUT_ERRORS = (MessageError, PlanningError, RoverError)
"""Errors of the input; any other error is an internal error."""

Answer = TypeVar("Answer")


def answer_or_refuse(
    logger, request: str, answer: Callable[[], Answer], refuse: Callable[[str, str], Answer]
) -> Answer:
    """Return `answer()`, or after an error `refuse(code, reason)`; log internal errors."""
    try:
        return answer()
    except INPUT_ERRORS as error:
        return refuse("bad_request", str(error))
    except Exception as error:
        # An internal error must not end the node.
        logger.error(f"{request}: {traceback.format_exc()}")
        return refuse("internal_error", f"{type(error).__name__}: {error}")
