# SPDX-License-Identifier: Apache-2.0
"""The table of the candidate paths; a click, or Enter, on a row shows its path."""

import html
import math
from collections.abc import Sequence

from rover_planner.viewer.state.candidate_rows import CandidateRow
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN, to_css


def draw_candidates(rows: Sequence[CandidateRow], shown: int) -> str:
    """Return the table as HTML; the row of the shown path, by its index, is marked."""
    heads = ("", "verdict", "length", "energy", "friction", "margin")
    units = ("", "", "[m]", "[J]", "largest", "smallest")
    head = "".join(
        f'<th style="font-weight:600;text-align:{_align(k)};padding:0 4px">{name}'
        f'<div style="font-weight:400;opacity:.7">{units[k]}&nbsp;</div></th>'
        for k, name in enumerate(heads)
    )
    body = "".join(_row(row, row.number - 1 == shown) for row in rows)
    return (
        '<div style="padding:0 8px"><style>#candidates tbody:is(:hover,:focus-within)'
        "{background:#f0e44259!important}</style>"
        '<table id="candidates" style="border-collapse:collapse;'
        f'width:100%;font-size:12px;line-height:1.35" role="grid"><tr>{head}</tr>{body}</table>'
        '<div style="font-size:12px;opacity:.75;padding-top:4px">Click a row to show its path. '
        "Values of a refused path are those up to its failure.</div></div>"
    )


def _row(row: CandidateRow, is_shown: bool) -> str:
    """Return the two rows of a candidate: its numbers, and its reason below them.

    The first row takes the focus; both are clicked as one.
    """
    colour = to_css(UNKNOWN if row.is_old else PASSABLE if row.verdict.traversable else REFUSED)
    back = "background:rgba(0,114,178,.12);" if is_shown else ""
    faded = "opacity:.5;" if row.is_old else ""
    word = "passable" if row.verdict.traversable else "refused"
    word += " (old)" if row.is_old else ""
    word += ", best" if row.is_best and row.verdict.traversable else ""
    length = f"{row.candidate.length:.2f}"
    length = length if row.verdict.traversable else f"{row.driven:.2f} / {length}"
    cells = (
        f"<b>{row.number}</b>",
        f'<span style="color:{colour}">&#9632;</span> {word}',
        length,
        f"{row.energy:.1f}",
        _number(row.verdict.max_friction_utilisation),
        _number(row.verdict.min_tip_over_ratio),
    )
    mark = f"border-left:4px solid {colour if is_shown else 'transparent'};"
    line = "".join(
        f'<td style="{mark if k == 0 else ""}text-align:{_align(k)};padding:3px 4px 0;'
        f'white-space:nowrap">{cell}</td>'
        for k, cell in enumerate(cells)
    )
    reason = html.escape(row.verdict.reason) or "&nbsp;"
    return (
        f'<tbody data-say="show {row.number}" style="{back}cursor:pointer;user-select:none">'
        f'<tr tabindex="0" aria-selected="{str(is_shown).lower()}" '
        f'style="{faded}border-top:1px solid #ddd">{line}</tr>'
        f'<tr style="{faded}"><td style="{mark}"></td>'
        f'<td colspan="5" style="padding:0 4px 3px;opacity:.8">{reason}</td></tr></tbody>'
    )


def _align(column: int) -> str:
    return "left" if column < 2 else "right"


def _number(value: float) -> str:
    if math.isnan(value):
        return "?"
    return f"{value:.2f}" if value < 100.0 else "&gt; 99"
