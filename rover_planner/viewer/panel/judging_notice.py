"""The notice above the tabs: what is worked on, with buttons to cancel it and to judge again."""

import html
from typing import Any

from rover_planner.viewer.state.colours import NOTICE, to_css
from rover_planner.viewer.state.visitor_requests import Action


class JudgingNotice:
    """Hidden while there is nothing to say."""

    def __init__(self, gui: Any, cancel: Action, judge_again: Action):
        """Add the notice to the container that is open.

        Args:
            gui: The GUI of viser.
            cancel: Stops the work.
            judge_again: Begins it again.
        """
        self._text = gui.add_html("", visible=False)
        self._cancel = gui.add_button("Cancel", visible=False)
        self._cancel.on_click(lambda _event: cancel())
        self._again = gui.add_button("Judge again", visible=False)
        self._again.on_click(lambda _event: judge_again())
        self._shown = ("", False)

    def show(self, text: str, in_work: bool) -> None:
        """Show what is worked on or was stopped; an empty text hides the notice."""
        if (text, in_work) == self._shown:
            return
        self._shown = (text, in_work)
        self._text.content = (
            f'<div id="judging" style="border-left:5px solid {to_css(NOTICE)};padding-left:.5em;'
            f'margin:4px 8px;font-size:13px">{html.escape(text)}</div>'
        )
        self._text.visible = bool(text)
        self._cancel.visible = bool(text) and in_work
        self._again.visible = bool(text) and not in_work
