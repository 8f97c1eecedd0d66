# SPDX-License-Identifier: Apache-2.0
"""Notices: what could not be drawn or done, why a request was refused, and what is worked on."""

import html
import traceback
from collections.abc import Callable
from typing import Any

from rover_planner.viewer.state.colours import FAILED, NOTICE, to_css
from rover_planner.viewer.state.session import REFUSALS
from rover_planner.viewer.state.visitor_requests import Action


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


class JudgingNotice:
    """Progress of the judging, with buttons, in every tab; hidden while there is none."""

    def __init__(self, gui: Any, cancel: Action, judge_again: Action):
        """Add the notice to the container that is open.

        Args:
            gui: The GUI of viser.
            cancel: Stops the work.
            judge_again: Begins it again.
        """
        self._refusal, self._text = (gui.add_html("", visible=False) for _ in range(2))
        self._cancel, self._again = (
            gui.add_button(name, visible=False) for name in ("Cancel", "Judge again")
        )
        self._cancel.on_click(lambda _event: cancel())
        self._again.on_click(lambda _event: judge_again())

    def show_refusal(self, reason: str) -> None:
        """Show why the last request was refused; an empty text hides it."""
        self._refusal.content = _frame("refusal", f"refused: {reason}")
        self._refusal.visible = bool(reason)

    def show(self, text: str, in_work: bool) -> None:
        """Show what is worked on or was stopped; an empty text hides the notice."""
        self._text.content = _frame("judging", text)
        self._text.visible = bool(text)
        self._cancel.visible = bool(text) and in_work
        self._again.visible = bool(text) and not in_work


def _frame(name: str, text: str) -> str:
    return (
        f'<div id="{name}" style="border-left:5px solid {to_css(NOTICE)};padding-left:.5em;'
        f'margin:4px 8px;font-size:13px;line-height:1.4">{html.escape(text)}</div>'
    )
