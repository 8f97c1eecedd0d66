# SPDX-License-Identifier: Apache-2.0
"""The header over the scene: rover, map, soil, policy and mode, the verdict, and what it plays."""

import html
from dataclasses import dataclass
from typing import Any

from rover_planner.viewer.state.colours import NOTICE, PASSABLE, REFUSED, UNKNOWN, Colour, to_css
from rover_planner.viewer.state.context import Context

LEFT, RIGHT = 310, 410
"""Distances of the header from the sides of a wide window [px]: beside the panels."""
SHEET = 576
"""Largest width of a window in which viser lists all panels in a sheet at the bottom [px]."""
HINT = (
    "Drag: turn the view. Wheel: nearer. Click on the ground: goal, with Shift: start. "
    "Space: play or pause. Arrows left and right: a waypoint."
)


@dataclass(frozen=True)
class Chip:
    """A word on a coloured ground."""

    word: str
    colour: Colour
    id: str


def verdict_chip(traversable: bool | None, old: str) -> Chip:
    """Return the chip of a verdict; grey if there is none, or one of old values."""
    word = {None: "no verdict", True: "traversable", False: "not traversable"}[traversable]
    colour = PASSABLE if traversable else REFUSED
    if traversable is None or old:
        colour = UNKNOWN
    return Chip(f"{word} (old values)" if old and traversable is not None else word, colour, "is")


def play_chip(playing: bool, words: str) -> Chip:
    """Return the chip of what is played."""
    return Chip(words, PASSABLE if playing else NOTICE, "plays")


class Header:
    """Shown over the scene, above all tabs."""

    def __init__(self, gui: Any):
        """Add the header, empty, and the hint for first visitors to the container that is open."""
        self._box = gui.add_html("")
        self._hint = gui.add_html(_hint())
        self._shown: tuple[Context, tuple[Chip, ...]] | None = None

    def show(self, context: Context, chips: tuple[Chip, ...]) -> None:
        """Show the context and its chips, if they have changed."""
        if (context, chips) != self._shown:
            self._shown = (context, chips)
            self._box.content = draw_header(context, chips)


def draw_header(context: Context, chips: tuple[Chip, ...]) -> str:
    """Return the header as HTML."""
    facts = "".join(
        f'<span style="white-space:nowrap"><span style="opacity:.65">{name}</span> '
        f"<b>{html.escape(value)}</b></span>"
        for name, value in (
            ("rover", context.rover),
            ("map", context.ground),
            ("soil", context.soil),
            ("torques", context.policy),
            ("mode", context.mode),
        )
        if value
    )
    words = "".join(
        f'<span data-chip="{chip.id}" style="background:{to_css(chip.colour)};color:#fff;'
        'font-weight:600;padding:.1em .7em;border-radius:1em;white-space:nowrap">'
        f"{html.escape(chip.word)}</span>"
        for chip in chips
    )
    return f'{_style()}<div id="header" class="over-scene" style="top:8px">{words}{facts}</div>'


def _style() -> str:
    """Return the rules that place things over the scene, beside the panels."""
    return (
        f"<style>.over-scene{{position:fixed;left:{LEFT}px;right:{RIGHT}px;z-index:5;"
        "display:flex;flex-wrap:wrap;gap:.3em 1em;align-items:center;justify-content:center;"
        "font-size:13px;line-height:1.5;padding:.35em .8em;border-radius:.5em;"
        "background:rgba(255,255,255,.88);color:#222;pointer-events:none;"
        "width:fit-content;margin:0 auto}"
        "[data-hint=off] #hint{display:none!important}"
        f"@media (max-width:{SHEET}px){{.over-scene{{left:8px;right:8px}}"
        "#hint{display:none!important}}"
        "</style>"
    )


def _hint() -> str:
    """Return the hint, which a visitor can close for ever."""
    close = (
        "localStorage.setItem('rover_planner-hint','off');"
        "document.documentElement.dataset.hint='off'"
    )
    return (
        f'<div id="hint" class="over-scene" style="bottom:8px"><span>{HINT}</span>'
        f'<button style="pointer-events:auto;cursor:pointer" onclick="{close}">Got it</button>'
        "</div>"
    )
