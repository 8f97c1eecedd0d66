# SPDX-License-Identifier: Apache-2.0
"""The notice of errors: what could not be drawn or done, and why."""

import html
import traceback
from collections.abc import Callable
from typing import Any

from rover_planner.viewer.state.colours import FAILED, to_css
from rover_planner.viewer.state.session import REFUSALS


class ErrorNotice:
    """Runs parts of the page's work; an error in one of them is shown and stops no other.

    A message stays until the same part succeeds. It is a red banner over the scene. Showing it
    sets a text and draws nothing else.
    """

    def __init__(self, gui: Any):
        """Add the notice, without a message, to the container that is open."""
        self._box = gui.add_html("", visible=False)
        self.messages: dict[str, str] = {}
        """The messages by failure."""

    def run(self, failure: str, work: Callable[[], None]) -> bool:
        """Run some work and return whether it succeeded.

        Args:
            failure: What the notice says of an error, such as "the plots are not drawn".
            work: The work.
        """
        try:
            work()
        except REFUSALS as error:
            self._show(failure, str(error))
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            if self.messages.get(failure) != message:
                traceback.print_exc()
            self._show(failure, message)
        else:
            self._show(failure, "")
            return True
        return False

    def _show(self, failure: str, message: str) -> None:
        """Show the message of a failure; remove it if it is empty."""
        if self.messages.get(failure, "") == message:
            return
        self.messages.pop(failure, None)
        if message:
            self.messages[failure] = message
        lines = "".join(
            f"<div><b>{html.escape(what)}</b>: {html.escape(why)}</div>"
            for what, why in self.messages.items()
        )
        self._box.content = (
            '<div id="errors" role="alert" class="over-scene" style="top:80px;z-index:20;'
            f"display:block;background:{to_css(FAILED)};color:#fff;font-size:16px;"
            f'padding:.6em 1em">{lines}</div>'
        )
        self._box.visible = bool(self.messages)
