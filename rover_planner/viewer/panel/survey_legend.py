# SPDX-License-Identifier: Apache-2.0
"""The legend of a survey's layer: its classes or its scale, what it is about, and what differs."""

import html
from collections.abc import Sequence

from rover_planner.viewer.state.colours import NOTICE, to_css
from rover_planner.viewer.state.survey_layers import ColouredGround, Key


def draw_survey_legend(
    name: str, told: str, meaning: ColouredGround, differences: Sequence[str]
) -> str:
    """Return the legend of a survey's layer as HTML.

    Args:
        name: Name of the layer.
        told: What it is about.
        meaning: What its colours mean.
        differences: In what the survey differs from what the page shows.
    """
    body = _draw_keys(meaning.keys)
    notice = ""
    if differences:
        notice = (
            f'<div id="survey-differs" style="border-left:5px solid {to_css(NOTICE)};'
            f'padding-left:.5em">not as on the page: {html.escape("; ".join(differences))}</div>'
        )
    return (
        '<div id="scale" style="font-size:12px;padding:4px 8px">'
        f"<div>{html.escape(name)}</div>{body}"
        f'<div style="opacity:.7">{html.escape(told)}</div>{notice}</div>'
    )


def _draw_keys(keys: Sequence[Key]) -> str:
    return "".join(
        f'<div><span style="background:{to_css(colour)};padding:0 .6em">&nbsp;</span> '
        f"{html.escape(text)}</div>"
        for colour, text in keys
    )
