# SPDX-License-Identifier: Apache-2.0
"""Lanes over the distance: for each limit a strip whose colours tell how much of it is used."""

import html
import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.state.colours import LOAD, MIDDLE, REFUSED, blend, to_css
from rover_planner.viewer.state.path_limits import Lane, PathLimits

ROW_HEIGHT = 14
"""Height of a lane [px]."""
GUTTER = 51
"""Width left of the lanes [px]: that of the axis of the plots below."""
RIGHT_GUTTER = 13
"""Width right of them [px]."""
WIDTH = 1000
"""Width of the drawing in its own units; the page stretches it."""
MIN_BROKEN = 40
"""Least width of a place where a limit is broken, in the same units."""
HALF, MUCH = 0.5, 0.8
"""Shares of a limit at which the colour changes."""
LITTLE_USED, HALF_USED, NEAR, BROKEN, NOT_ASKED = range(5)
COLOURS = {
    LITTLE_USED: to_css(blend(LOAD, (255, 255, 255), 0.7)),
    HALF_USED: to_css(LOAD),
    NEAR: to_css(MIDDLE),
    BROKEN: to_css(REFUSED),
    NOT_ASKED: "url(#not-asked)",
}
WORDS = {
    LITTLE_USED: "to 50 %",
    HALF_USED: "to 80 %",
    NEAR: "to 100 % used",
    BROKEN: "broken",
    NOT_ASKED: "not asked",
}
HATCH = (
    '<pattern id="not-asked" width="16" height="5" patternUnits="userSpaceOnUse">'
    '<rect width="16" height="5" fill="#eee"/>'
    '<path d="M0 5 L16 0" stroke="#888" stroke-width="1.5"/></pattern>'
)


class Lanes:
    """The lanes of the shown path in a panel of the page, with a cursor."""

    def __init__(self, gui: Any):
        """Add empty lanes to the container that is open."""
        self._box = gui.add_html("")
        self._end = 0.0
        self._labels = self._drawing = ""

    def set_limits(self, limits: PathLimits | None) -> None:
        """Show the limits along another path; None shows nothing."""
        self._drawing = self._box.content = ""
        if limits is not None and limits.end > 0.0:
            self._end = limits.end
            self._labels, self._drawing = _label_lanes(limits), draw_lanes(limits)
            self.move_cursor(0.0)

    def move_cursor(self, distance: float) -> None:
        """Show the cursor at a distance [m]."""
        if not self._drawing:
            return
        height = ROW_HEIGHT * self._labels.count("</div>")
        x = WIDTH * min(max(distance / self._end, 0.0), 1.0)
        self._box.content = (
            '<div id="lanes" style="padding:0 8px 4px;font-size:12px;line-height:1">'
            f'<div style="display:flex;padding-right:{RIGHT_GUTTER}px">'
            f'<div style="width:{GUTTER}px;text-align:right;flex:none">{self._labels}</div>'
            f'<svg data-along viewBox="0 0 {WIDTH} {height}" preserveAspectRatio="none" '
            f'style="flex:1;min-width:0;height:{height}px">{self._drawing}'
            f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="100%" stroke="#333" stroke-width="2" '
            f'vector-effect="non-scaling-stroke"/></svg></div>{_legend()}</div>'
        )


def draw_lanes(limits: PathLimits) -> str:
    """Return the lanes as parts of an SVG, one below the other, and where poses lie between."""
    parts = [f"<defs>{HATCH}</defs>"]
    edges = WIDTH * _edges(limits.rows.distance) / limits.end
    for k, lane in enumerate(limits.lanes):
        pieces = list(_pieces(lane))
        pieces.sort(key=lambda piece: piece[2] == BROKEN)
        parts += [_piece(lane, limits, piece, edges, k) for piece in pieces]
    top = len(limits.lanes) * ROW_HEIGHT
    between = WIDTH * np.unique(limits.rows.distance[limits.rows.is_between]) / limits.end
    ticks = "".join(f"M{x:.0f} {top + 2}v9" for x in np.unique(np.round(between)))
    parts.append(
        f'<path d="{ticks}" stroke="#666" stroke-width="1" fill="none" '
        'vector-effect="non-scaling-stroke"><title>the model was asked between waypoints'
        "</title></path>"
    )
    return "".join(parts)


def classify(lane: Lane) -> Floats:
    """Return the class (m,) of each pose on a lane, a key of COLOURS."""
    with np.errstate(invalid="ignore"):
        shares = np.select([lane.used <= HALF, lane.used <= MUCH], [LITTLE_USED, HALF_USED], NEAR)
    return np.select([lane.used > 1.0, np.isnan(lane.used)], [BROKEN, NOT_ASKED], shares)


def _edges(distance: Floats) -> Floats:
    """Return the edges (m + 1,) of the stretches that poses stand for [m]."""
    middles = 0.5 * (distance[1:] + distance[:-1])
    return np.concatenate([[0.0], middles, [distance[-1]]])


def _pieces(lane: Lane) -> Iterator[tuple[int, int, int]]:
    """Yield first row, end and class of each stretch of one class."""
    first = 0
    for kind, run in itertools.groupby(classify(lane).tolist()):
        end = first + len(list(run))
        yield first, end, int(kind)
        first = end


def _piece(
    lane: Lane, limits: PathLimits, piece: tuple[int, int, int], edges: Floats, k: int
) -> str:
    """Return a stretch of lane number k as a rectangle with a tool tip."""
    first, end, kind = piece
    left, right = float(edges[first]), float(edges[end])
    if kind == BROKEN and right - left < MIN_BROKEN:
        left = min(max(0.5 * (left + right - MIN_BROKEN), 0.0), WIDTH - MIN_BROKEN)
        right = left + MIN_BROKEN
    note = _describe(lane, limits, (first, end), kind)
    return (
        f'<rect x="{left:.1f}" y="{k * ROW_HEIGHT + 1}" width="{right - left + 0.3:.1f}" '
        f'height="{ROW_HEIGHT - 2}" fill="{COLOURS[kind]}"><title>{html.escape(note)}'
        "</title></rect>"
    )


def _describe(lane: Lane, limits: PathLimits, rows: tuple[int, int], kind: int) -> str:
    """Return the worst of some rows in words."""
    first, end = rows
    begins, ends = limits.rows.distance[first], limits.rows.distance[end - 1]
    stretch = f"{begins:.2f} m to {ends:.2f} m"
    if kind == NOT_ASKED:
        return f"{lane.limit.title}: does not count or is not known, {stretch}"
    used = np.where(np.isnan(lane.used[first:end]), -np.inf, lane.used[first:end])
    at = first + int(np.argmax(used))
    value = lane.values[at]
    words = lane.limit.title if np.isnan(value) else lane.limit.compare(float(value))
    wheel = int(lane.wheel[at])
    named = f", {WHEELS[wheel].replace('_', ' ')}" if wheel >= 0 else ""
    return f"{words}{named}; {stretch}"


def _label_lanes(limits: PathLimits) -> str:
    titles = [lane.limit.title for lane in limits.lanes] + ["between"]
    return "".join(
        f'<div style="height:{ROW_HEIGHT}px;line-height:{ROW_HEIGHT}px;padding-right:3px;'
        f'white-space:nowrap">{title}</div>'
        for title in titles
    )


def _legend() -> str:
    def swatch(kind: int) -> str:
        if kind == NOT_ASKED:
            return "repeating-linear-gradient(135deg,#eee 0 3px,#888 3px 4px)"
        return COLOURS[kind]

    keys = "".join(
        f'<span style="white-space:nowrap"><span style="background:{swatch(kind)};'
        f'padding:0 .5em">&nbsp;</span>&nbsp;{word}</span> '
        for kind, word in WORDS.items()
    )
    return f'<div id="lanes-legend" style="line-height:1.4;padding-top:3px">{keys}</div>'
