# SPDX-License-Identifier: Apache-2.0
"""The list of a live rover's topics with their ages; stale ones are grey."""

import html
from collections.abc import Sequence
from typing import Protocol

from rover_planner.viewer.state.colours import NOTICE, to_css


class Age(Protocol):
    """The age of a topic's last message."""

    @property
    def topic(self) -> str:
        """Name of the topic."""

    @property
    def is_stale(self) -> bool:
        """Whether its values are no longer those of the rover."""

    def describe(self) -> str:
        """Return the age in words."""


def draw_topics(ages: Sequence[Age]) -> str:
    """Return the list as HTML."""
    rows = "".join(
        f'<div data-topic="{html.escape(one.topic)}" data-stale="{str(one.is_stale).lower()}" '
        f'style="display:flex;justify-content:space-between;gap:1em;'
        f'{"opacity:.45;filter:grayscale(1)" if one.is_stale else ""}">'
        f"<span>{html.escape(one.topic)}</span>"
        f"<span>{'stale, ' if one.is_stale else ''}{one.describe()}</span></div>"
        for one in ages
    )
    return (
        '<div id="topics" style="font-size:12px;line-height:1.4;padding:4px 8px">'
        f'<div style="border-top:1px solid {to_css(NOTICE)};opacity:.7">'
        f"age of the last message</div>{rows}</div>"
    )
