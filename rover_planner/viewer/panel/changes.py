# SPDX-License-Identifier: Apache-2.0
"""The table of what has changed of the rover and of its drive."""

import html
import math
from collections.abc import Mapping, Sequence

from rover_planner.viewer.state.before_after import Difference
from rover_planner.viewer.state.colours import NOTICE, to_css

SAME = "0"
"""Change of a number that stays the same."""
HEIGHT = 92
"""Height of the table [px], whatever is in it, so that no slider moves under the mouse. A longer
table scrolls."""
NOTHING = '<div style="padding:0 4px;opacity:0.7">nothing is changed</div>'


def draw_changes(
    changed: Mapping[str, tuple[float, float]], differences: Sequence[Difference]
) -> str:
    """Return tables, HTML: numbers of the rover as loaded and now, of the drive before and now.

    Numbers of the drive that are the same are left out.
    """
    parts = []
    if changed:
        rows = [
            (_name(label), f"{was:g}", f"{now:g}", f"{now - was:+.4g}")
            for label, (was, now) in changed.items()
        ]
        parts.append(_table(("rover", "loaded", "now", "change"), rows))
    if differences:
        rows = [
            (
                f"{one.name} [{one.unit}]" if one.unit else one.name,
                _number(one.before, one.digits),
                _number(one.after, one.digits),
                _change(one),
            )
            for one in differences
            if _change(one) != SAME
        ]
        if rows:
            parts.append(_table(("drive", "before", "now", "change"), rows))
        else:
            parts.append('<div style="padding:0 4px">the drive is the same as before</div>')
    colour = to_css(NOTICE) if parts else "transparent"
    return (
        f'<div id="changes" style="border-left:5px solid {colour};margin:0 8px;padding-left:.5em;'
        f'font-size:12px;height:{HEIGHT}px;overflow-y:auto">{"".join(parts) or NOTHING}</div>'
    )


def _table(heads: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    def line(cells: tuple[str, ...], tag: str) -> str:
        return "".join(
            f'<{tag} style="text-align:{"right" if k else "left"};padding:0 4px">'
            f"{html.escape(cell)}</{tag}>"
            for k, cell in enumerate(cells)
        )

    body = "".join(f"<tr>{line(row, 'td')}</tr>" for row in rows)
    return (
        '<table style="width:100%;border-collapse:collapse;margin-bottom:4px">'
        f"<tr>{line(heads, 'th')}</tr>{body}</table>"
    )


def _name(label: str) -> str:
    """Return the label of a slider, such as "wheels z [m]", as the name of a row."""
    return label.replace(" [-]", "").replace(" [", ", ").removesuffix("]")


def _number(value: float, digits: int) -> str:
    if math.isnan(value):
        return "?"
    return f"{value:.{digits}f}" if abs(value) < 1e5 else "infinite"


def _change(one: Difference) -> str:
    change = one.change
    if not math.isfinite(change) or abs(change) > 1e5:
        return ""
    return f"{change:+.{one.digits}f}" if abs(change) >= 0.5 * 10**-one.digits else SAME
