# SPDX-License-Identifier: Apache-2.0
"""The scale of the ground's colours: values, the limit, classes and what grey and hatched mean."""

import html

from rover_planner.viewer.state.colours import (
    BEYOND,
    UNKNOWN,
    Colour,
    ColourScale,
    map_colours,
    to_css,
)

STOPS = 9
"""Colours from which the gradient is made."""
HATCH = "repeating-linear-gradient(135deg,{colour} 0 4px,{dark} 4px 7px)"


def draw_scale(name: str, scale: ColourScale) -> str:
    """Return the scale of a layer as HTML.

    Args:
        name: What is coloured.
        scale: What the colours mean.
    """
    parts = [f"<div><b>{html.escape(name)}</b></div>"]
    if scale.classes:
        parts += [_key(to_css(colour), word) for word, colour in scale.classes]
    else:
        parts.append(_gradient(scale))
    if scale.limit is not None or scale.classes:
        dark = to_css(_darker(BEYOND))
        words = "breaks a limit" if scale.classes else f"beyond the limit of {_write(scale)}"
        parts.append(_key(HATCH.format(colour=to_css(BEYOND), dark=dark), words))
    parts.append(_key(to_css(UNKNOWN), "unknown, or the rover cannot stand"))
    parts.append('<div style="opacity:.75">a line every metre</div>')
    return (
        '<div id="scale" style="font-size:12px;line-height:1.5;padding:4px 8px">'
        f"{''.join(parts)}</div>"
    )


def _gradient(scale: ColourScale) -> str:
    """Return the bar of colours with its ends, and a mark at the limit."""
    import numpy as np

    colours = map_colours(np.linspace(0.0, 1.0, STOPS), 0.0, 1.0)
    stops = ",".join(to_css((int(r), int(g), int(b))) for r, g, b in colours)
    mark = ""
    if scale.limit is not None and scale.low <= scale.limit <= scale.high:
        share = 100.0 * (scale.limit - scale.low) / (scale.high - scale.low)
        side = "right" if share > 50.0 else "left"
        at = 100.0 - share if share > 50.0 else share
        mark = (
            f'<div id="limit" style="position:absolute;{side}:{at:.1f}%;top:-3px;height:16px;'
            f'border-{side}:4px solid {to_css(BEYOND)}"></div>'
        )
    limit = f"limit {_write(scale)}" if mark else ""
    ends = [f"{value:.2f} {scale.unit}".strip() for value in (scale.low, scale.high)]
    if scale.limit == scale.low:
        ends[0] = limit
    elif scale.limit == scale.high:
        ends[1] = limit
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


def _darker(colour: Colour) -> Colour:
    red, green, blue = (int(0.5 * part) for part in colour)
    return red, green, blue
