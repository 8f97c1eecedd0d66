# SPDX-License-Identifier: Apache-2.0
"""The notices above the tabs: why a request was refused, and what is worked on, with buttons."""

import html
from typing import Any

from rover_planner.viewer.state.colours import NOTICE, to_css
from rover_planner.viewer.state.visitor_requests import Action


class JudgingNotice:
    """Hidden while there is nothing to say; else seen in every tab."""

    def __init__(self, gui: Any, cancel: Action, judge_again: Action):
        """Add the notice to the container that is open.

        Args:
            gui: The GUI of viser.
            cancel: Stops the work.
            judge_again: Begins it again.
        """
        self._refusal = gui.add_html("", visible=False)
        self._text = gui.add_html("", visible=False)
        self._cancel = gui.add_button("Cancel", visible=False)
        self._cancel.on_click(lambda _event: cancel())
        self._again = gui.add_button("Judge again", visible=False)
        self._again.on_click(lambda _event: judge_again())
        self._shown = ("", False)

    def show_refusal(self, reason: str) -> None:
        """Show why the last request was refused; an empty text hides it."""
        self._refusal.content = _frame("refusal", f"refused: {reason}")
        self._refusal.visible = bool(reason)

    def show(self, text: str, in_work: bool) -> None:
        """Show what is worked on or was stopped; an empty text hides the notice."""
        if (text, in_work) == self._shown:
            return
        self._shown = (text, in_work)
        self._text.content = _frame("judging", text)
        self._text.visible = bool(text)
        self._cancel.visible = bool(text) and in_work
        self._again.visible = bool(text) and not in_work


def _frame(name: str, text: str) -> str:
    return (
        f'<div id="{name}" style="border-left:5px solid {to_css(NOTICE)};padding-left:.5em;'
        f'margin:4px 8px;font-size:13px;line-height:1.4">{html.escape(text)}</div>'
    )
