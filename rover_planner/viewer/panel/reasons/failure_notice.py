# SPDX-License-Identifier: Apache-2.0
"""A failure in words for the verdict, and the button below it that goes there."""

import html
from typing import Any

from rover_planner.viewer.state.colours import REFUSED, to_css
from rover_planner.viewer.state.reasons.failure import Failure
from rover_planner.viewer.state.visitor_requests import Action

MARK_STYLE = (
    "<style>.mantine-Slider-markWrapper:only-child>.mantine-Slider-mark"
    f"{{border-color:{to_css(REFUSED)};background:{to_css(REFUSED)}}}"
    ".mantine-Slider-markWrapper:only-child>.mantine-Slider-markLabel"
    f"{{color:{to_css(REFUSED)};font-weight:700;font-size:12px!important;margin-top:3px}}</style>"
)
"""Colours the mark of a failure; other sliders have two marks, at their ends."""


class FailureButton:
    """A button that goes to the failure, hidden while the shown path can be driven."""

    def __init__(self, gui: Any, go_there: Action):
        """Add the button to the container that is open.

        Args:
            gui: The GUI of viser.
            go_there: Shows the rover at the failure.
        """
        self._button = gui.add_button("Go to the failure", visible=False)
        self._button.on_click(lambda _event: go_there())

    def show(self, failure: Failure | None) -> None:
        """Show the button; None hides it."""
        self._button.visible = failure is not None


def describe_failure(failure: Failure) -> str:
    """Return a failure as HTML: limit, value, link and place."""
    between = ", between waypoints" if failure.is_between else ""
    return (
        f'{MARK_STYLE}<span id="failure"><b>{html.escape(failure.headline)}</b>, '
        f"after {failure.distance:.2f} m, {failure.time:.0f} s{between}</span>"
    )
