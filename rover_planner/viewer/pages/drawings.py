# SPDX-License-Identifier: Apache-2.0
"""Drawings that follow the verdict one by one, and errors in parts of the work, which are told."""

import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager

from rover_planner.viewer.state.session import REFUSALS

Action = Callable[[], None]


class Errors:
    """Runs parts of the page's work; an error in one of them is told and stops no other."""

    def __init__(self, tell: Callable[[list[list[str]]], None]):
        """Tell nothing yet; `tell` shows what failed and why."""
        self._tell = tell
        self.messages: dict[str, str] = {}
        """The messages by what failed; each stays until the same part succeeds."""

    def run(self, failure: str, work: Action) -> bool:
        """Run some work and return whether it succeeded.

        Args:
            failure: What is told of an error, such as "the paths are not drawn".
            work: The work.
        """
        message = ""
        try:
            work()
        except REFUSALS as error:
            message = str(error)
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            if self.messages.get(failure) != message:
                traceback.print_exc()
        if self.messages.get(failure, "") != message:
            self.messages.pop(failure, None)
            self.messages |= {failure: message} if message else {}
            self._tell([[what, why] for what, why in self.messages.items()])
        return not message


class Drawings:
    """Drawings in the order in which they were asked for; each shows what there is by then.

    One that is asked for again while it waits is done once, at its old place in the order.
    """

    def __init__(self, errors: Errors, together: Callable[[], AbstractContextManager[None]]):
        """Begin with nothing to draw.

        Args:
            errors: Tells what could not be drawn.
            together: Returns a context whose messages reach the visitors together.
        """
        self._errors, self._together = errors, together
        self._asked: dict[str, Action] = {}

    @property
    def waiting(self) -> bool:
        """True if something is still to be drawn, or is being drawn."""
        return bool(self._asked)

    def ask(self, failure: str, draw: Action) -> None:
        """Draw something soon; `failure`, what is told if that fails, tells drawings apart."""
        self._asked[failure] = draw

    def draw_next(self) -> None:
        """Draw what has waited longest, if there is anything."""
        if not self._asked:
            return
        failure, draw = next(iter(self._asked.items()))
        with self._together():
            self._errors.run(failure, draw)
        if self._asked[failure] is draw:
            del self._asked[failure]
