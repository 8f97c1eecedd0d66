"""Whatever is wrong with a request makes a refusal with a reason, never the end of the node."""

import traceback
from collections.abc import Callable
from typing import TypeVar

from msg_adapters.errors import MessageError
from rover_physics.errors import RoverError
from rover_planner.errors import PlanningError

INPUT_ERRORS = (MessageError, PlanningError, RoverError)
"""Errors that are about what was asked, not about this program."""

Answer = TypeVar("Answer")


def answer_or_refuse(
    logger, request: str, answer: Callable[[], Answer], refuse: Callable[[str, str], Answer]
) -> Answer:
    """Return the answer to a request, or the refusal of it with code and reason."""
    try:
        return answer()
    except INPUT_ERRORS as error:
        return refuse("bad_request", str(error))
    except Exception as error:
        # A fault of this program must not leave the rover without a planner.
        logger.error(f"{request}: {traceback.format_exc()}")
        return refuse("internal_error", f"{type(error).__name__}: {error}")
