# SPDX-License-Identifier: Apache-2.0
"""The legend of the ground's colours: values, the limit, classes, what grey and hatched mean."""

import html
from collections.abc import Sequence

import numpy as np

from rover_planner.viewer.state.colours import (
    BEYOND,
    NOTICE,
    UNKNOWN,
    ColourScale,
    blend,
    map_colours,
    to_css,
)
from rover_planner.viewer.state.survey_layers import ColouredGround

STOPS = 9
"""Colours from which the gradient is made."""
BLACK = (0, 0, 0)


def draw_scale(name: str, scale: ColourScale) -> str:
    """Return the legend of a layer as HTML.

    Args:
        name: What is coloured.
        scale: What the colours mean.
    """
    parts = [_key(to_css(colour), word) for word, colour in scale.classes] or [_gradient(scale)]
    if scale.limit is not None or scale.classes:
        colour, dark = to_css(BEYOND), to_css(blend(BEYOND, BLACK, 0.5))
        words = "breaks a limit" if scale.classes else f"beyond the limit of {_write(scale)}"
        hatch = f"repeating-linear-gradient(135deg,{colour} 0 4px,{dark} 4px 7px)"
        parts.append(_key(hatch, words))
    parts.append(_key(to_css(UNKNOWN), "unknown, or the rover cannot stand"))
    parts.append('<div style="opacity:.75">a line every metre</div>')
    return _frame(name, parts)


def draw_survey_legend(
    name: str, description: str, meaning: ColouredGround, differences: Sequence[str]
) -> str:
    """Return the legend of a survey's layer as HTML.

    Args:
        name: Name of the layer.
        description: What it is about.
        meaning: What its colours mean.
        differences: In what the survey differs from what the page shows.
    """
    parts = [_key(to_css(colour), text) for colour, text in meaning.keys]
    parts.append(f'<div style="opacity:.75">{html.escape(description)}</div>')
    if differences:
        parts.append(
            f'<div id="survey-differs" style="border-left:5px solid {to_css(NOTICE)};'
            f'padding-left:.5em">not as on the page: {html.escape("; ".join(differences))}</div>'
        )
    return _frame(name, parts)


def _frame(name: str, parts: Sequence[str]) -> str:
    return (
        '<div id="scale" style="font-size:12px;line-height:1.5;padding:4px 8px">'
        f"<div><b>{html.escape(name)}</b></div>{''.join(parts)}</div>"
    )


def _gradient(scale: ColourScale) -> str:
    """Return the bar of colours with its ends, and a mark at the limit."""
    colours = map_colours(np.linspace(0.0, 1.0, STOPS), 0.0, 1.0)
    stops = ",".join(to_css((int(r), int(g), int(b))) for r, g, b in colours)
    mark = ""
    ends = [f"{value:.2f} {scale.unit}".strip() for value in (scale.low, scale.high)]
    if scale.limit is not None and scale.low <= scale.limit <= scale.high:
        share = 100.0 * (scale.limit - scale.low) / (scale.high - scale.low)
        side, at = ("right", 100.0 - share) if share > 50.0 else ("left", share)
        mark = (
            f'<div id="limit" style="position:absolute;{side}:{at:.1f}%;top:-3px;height:16px;'
            f'border-{side}:4px solid {to_css(BEYOND)}"></div>'
        )
        for k, end in enumerate((scale.low, scale.high)):
            if scale.limit == end:
                ends[k] = f"limit {_write(scale)}"
    return (
        '<div style="position:relative;margin:4px 0"><div style="height:10px;'
        f'background:linear-gradient(90deg,{stops})"></div>{mark}</div>'
        '<div style="display:flex;justify-content:space-between">'
        f"<span>{ends[0]}</span><span>{ends[1]}</span></div>"
    )


def _write(scale: ColourScale) -> str:
    return f"{scale.limit:.2f} {scale.unit}".strip()


def _key(background: str, words: str) -> str:
    return (
        f'<div><span style="display:inline-block;width:22px;height:10px;background:{background}">'
        f"</span>&nbsp;{html.escape(words)}</div>"
    )
