# SPDX-License-Identifier: Apache-2.0
"""Errors in parts of the page's work, which are told and stop no other part."""

import traceback
from collections.abc import Callable

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
