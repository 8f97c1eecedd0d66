# SPDX-License-Identifier: Apache-2.0
"""The board, after the paper's Figure 5: the rover from above with bars, and the worst so far."""

import html
import math
from dataclasses import dataclass

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.viewer.state.colours import (
    LOAD,
    MIDDLE,
    PASSABLE,
    REFUSED,
    TRACTION,
    colour_utilisation,
    to_css,
)
from rover_planner.viewer.state.path_limits import WorstUse
from rover_planner.viewer.state.trajectory import RoverState

WIDTH, HEIGHT = 364, 232
"""Size of the drawing [px]."""
BAR_HEIGHT = 42.0
"""Height of a full bar [px]."""
COLUMNS = {"left": 64.0, "right": 174.0}
ROWS = {"front": 36.0, "middle": 112.0, "rear": 188.0}
"""Centres of the wheels in the drawing [px], across and down."""
WHEEL_WIDTH, WHEEL_LENGTH, RING = 20.0, 44.0, 4.0
"""Size of a wheel in the drawing, and distance of the outline of one that fails [px]. A wheel that
is turned by 90 degrees stays off its bars."""
BODY = (91.0, 40.0, 56.0, 150.0)
"""Left, top, width and height of the body [px]."""
LIST_LEFT, LIST_TOP, MAX_PITCH = 252.0, 12.0, 34.0
"""Where the worst uses are listed, and their largest distance [px]."""
LIST_BAR = 22.0
"""Length of the bar of a worst use [px]; its limit is written beside it."""
MAX_MARGIN = 1.2
"""Stability margin at the end of the gauge."""
FONT = 12
"""Size of the smallest letters and digits [px]."""
SLIP, TRACTION_RATIO = "slip ratio", "T/(&mu;N)"
"""Quantities that the second bar of a wheel can show."""


@dataclass(frozen=True)
class BoardNotes:
    """Content of the board besides the state."""

    has_slip: bool = True
    """True if slip is predicted, on yielding soil or with speed servos. Else the second bar of a
    wheel is the paper's T/(mu N)."""
    worst: tuple[WorstUse, ...] = ()
    """The worst uses so far."""
    failing: str = ""
    """The link that fails on the path, empty for none."""


def draw_board(rover: Rover, state: RoverState, notes: BoardNotes) -> str:
    """Return the board as SVG: wheels from above, turned as steered, the front at the top.

    Beside each wheel are bars of its torque saturation and of its slip ratio or T/(mu N), below it
    its normal force; the wheel's colour is its friction utilisation.

    Args:
        rover: The rover, for its limits.
        state: The values to show.
        notes: What else is shown.
    """
    parts = [_body(notes.failing)]
    for wheel, name in enumerate(WHEELS):
        position, side = name.rsplit("_", 1)
        parts.append(_wheel(state, wheel, (COLUMNS[side], ROWS[position]), notes))
    parts.append(_gauge(state.tip_over_ratio, rover.limits.tip_over_ratio))
    if notes.worst:
        parts.append(_list_worst(notes.worst))
    return (
        f'<svg id="board" viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" '
        f'aria-label="rover from above" font-family="sans-serif" font-size="{FONT}">'
        f"{''.join(parts)}</svg>"
    )


def draw_legend(notes: BoardNotes) -> str:
    """Return the legend of the board as HTML."""
    second = SLIP if notes.has_slip else TRACTION_RATIO
    ends = "".join(
        f'<span style="background:{to_css(colour)};padding:0 .4em">&nbsp;</span>'
        for colour in map(colour_utilisation, (0.0, 0.25, 0.5, 0.75, 1.0))
    )
    return (
        f'<div style="font-size:{FONT}px;line-height:1.5">'
        f"{_key(LOAD, 'torque')} {_key(TRACTION, second)} wheels: friction 0 {ends} 1</div>"
    )


def _key(colour: tuple[int, int, int], text: str) -> str:
    box = f'<span style="background:{to_css(colour)};padding:0 .5em">&nbsp;</span>'
    return f'<span style="white-space:nowrap">{box}&nbsp;{text}</span>'


def _body(failing: str) -> str:
    left, top, width, height = BODY
    middle = left + width / 2
    fails = failing == "body"
    edge = f'stroke="{to_css(REFUSED)}" stroke-width="4"' if fails else 'stroke="#888"'
    parts = [
        f'<rect x="{left}" y="{top}" width="{width}" height="{height}" rx="8" fill="#eee8d8" '
        f'{edge} data-failing="{str(fails).lower()}"/>'
        f'<path d="M{middle} {top + 8} l9 14 h-18 z" fill="#888"/>'
        f'<text x="{middle}" y="{top + 36}" text-anchor="middle" fill="#555">front</text>'
    ]
    for side, x in (("left", left), ("right", left + width)):
        fails = failing in (f"rocker_{side}", f"bogie_{side}")
        colour, thick = (to_css(REFUSED), 6) if fails else ("#888", 3)
        end = COLUMNS[side] + (11 if side == "left" else -11)
        parts.append(
            f'<line x1="{x}" x2="{end}" y1="104" y2="104" stroke="{colour}" '
            f'stroke-width="{thick}" data-failing="{str(fails).lower()}"/>'
        )
    return "".join(parts)


def _wheel(state: RoverState, wheel: int, centre: tuple[float, float], notes: BoardNotes) -> str:
    """Draw a wheel with its centre at x, y [px], and its bars on the outer side."""
    x, y = centre
    name, is_left = WHEELS[wheel], WHEELS[wheel].endswith("left")
    utilisation = float(state.friction_utilisation[wheel])
    bars = x - 64.0 if is_left else x + 20.0
    angle = math.degrees(float(state.steering_angle[wheel]))
    turned = f", turned {angle:.0f} deg" if abs(angle) >= 0.5 else ""
    turn = f'transform="rotate({-angle:.1f} {x:.0f} {y:.0f})"'
    second = _slip(state, wheel) if notes.has_slip else _traction_ratio(state, wheel)
    word = SLIP if notes.has_slip else TRACTION_RATIO
    fails = notes.failing == name
    ring = (
        f'<rect {_place_wheel(centre, RING)} rx="8" fill="none" '
        f'stroke="{to_css(REFUSED)}" stroke-width="4" {turn} data-failing="true"/>'
    )
    return (
        f'<rect {_place_wheel(centre)} rx="5" {turn} '
        f'fill="{to_css(colour_utilisation(utilisation))}" stroke="#333">'
        f"<title>{name}: friction utilisation {write(utilisation, 2)}{turned}"
        "</title></rect>"
        + (ring if fails else "")
        + _bar((bars, y), float(state.torque_saturation[wheel]), to_css(LOAD), "torque saturation")
        + _bar((bars + 24, y), second, to_css(TRACTION), word)
        + f'<text x="{x + (-14 if is_left else 14):.0f}" y="{y + 40:.0f}" text-anchor="middle" '
        f'fill="currentColor">{write(float(state.wheel_loads[wheel]), 1)} N</text>'
    )


def _place_wheel(centre: tuple[float, float], around: float = 0.0) -> str:
    """Return place and size of a wheel's rectangle, or of one around it [px]."""
    x, y = centre[0] - WHEEL_WIDTH / 2 - around, centre[1] - WHEEL_LENGTH / 2 - around
    width, height = WHEEL_WIDTH + 2 * around, WHEEL_LENGTH + 2 * around
    return f'x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}"'


def _slip(state: RoverState, wheel: int) -> float:
    return abs(float(state.slip_ratio[wheel]))


def _traction_ratio(state: RoverState, wheel: int) -> float:
    """Return the paper's |T| / (mu N); NaN if one of them is not known."""
    most = float(state.friction[wheel] * state.wheel_loads[wheel])
    T = abs(float(state.tangential[wheel]))
    if most > 0.0:
        return T / most
    return math.nan if math.isnan(most) else math.inf


def _bar(place: tuple[float, float], share: float, colour: str, name: str) -> str:
    """Draw a bar of a share of 1 with its left edge at x and its middle at y [px]."""
    x, y = place
    height = BAR_HEIGHT * min(max(np.nan_to_num(share), 0.0), 1.0)
    top, bottom = y - BAR_HEIGHT / 2 + 4, y + BAR_HEIGHT / 2 + 4
    over = f' stroke="{to_css(REFUSED)}" stroke-width="2"' if share > 1.0 else ' stroke="#999"'
    return (
        f'<rect x="{x + 4:.0f}" y="{top:.1f}" width="14" height="{BAR_HEIGHT}" fill="none"{over}>'
        f"<title>{name} {write(share, 2)}</title></rect>"
        f'<rect x="{x + 4:.0f}" y="{bottom - height:.1f}" width="14" height="{height:.1f}" '
        f'fill="{colour}"/>'
        f'<text x="{x + 11:.0f}" y="{top - 3:.0f}" text-anchor="middle" '
        f'fill="currentColor">{_short(share)}</text>'
    )


def _short(share: float) -> str:
    if math.isnan(share):
        return "?"
    return f"{share:.2f}".lstrip("0") if share < 0.995 else f"{min(share, 99.0):.1f}"


def _gauge(ratio: float, limit: float) -> str:
    """Draw the stability margin on a half circle from 0 to MAX_MARGIN, with its limit."""
    x, y, radius = BODY[0] + BODY[2] / 2, 136.0, 21.0

    def point(value: float, r: float) -> tuple[float, float]:
        angle = math.pi * (1.0 - min(max(value, 0.0), MAX_MARGIN) / MAX_MARGIN)
        return x + r * math.cos(angle), y - r * math.sin(angle)

    def arc(start: float, end: float, colour: str) -> str:
        (ax, ay), (bx, by) = point(start, radius), point(end, radius)
        return (
            f'<path d="M{ax:.1f} {ay:.1f} A{radius} {radius} 0 0 1 {bx:.1f} {by:.1f}" '
            f'fill="none" stroke="{colour}" stroke-width="6"/>'
        )

    tip_x, tip_y = point(0.0 if math.isnan(ratio) else ratio, radius - 2)
    return (
        arc(0.0, limit, to_css(REFUSED))
        + arc(limit, MAX_MARGIN, to_css(PASSABLE))
        + f'<line x1="{x}" y1="{y}" x2="{tip_x:.1f}" y2="{tip_y:.1f}" stroke="#222" '
        'stroke-width="2.5"/>'
        f'<text x="{x}" y="{y + 14}" text-anchor="middle" fill="#333">{write(ratio, 2)}</text>'
        f'<text x="{x}" y="{y + 27}" text-anchor="middle" fill="#333">stability</text>'
        f'<text x="{x}" y="{y + 39}" text-anchor="middle" fill="#333">margin</text>'
    )


def _list_worst(worst: tuple[WorstUse, ...]) -> str:
    """List the worst uses so far: value of limit, and a bar of the share that is used."""
    x, width = LIST_LEFT, WIDTH - LIST_LEFT - 2
    pitch = min((HEIGHT - LIST_TOP - 4) / len(worst), MAX_PITCH)
    parts = [
        f'<text x="{x}" y="{LIST_TOP}" fill="currentColor" font-weight="bold">worst so far</text>'
    ]
    for k, one in enumerate(worst):
        y = LIST_TOP + 16 + k * pitch
        share = 0.0 if math.isnan(one.used) else min(max(one.used, 0.0), 1.0)
        share = 1.0 if one.is_broken else share
        colour = to_css(REFUSED if one.is_broken else MIDDLE if share > 0.8 else LOAD)
        bold = ' font-weight="bold"' if one.is_broken else ""
        wheel = f"{one.title}, {one.wheel.replace('_', ' ')}" if one.wheel else one.title
        parts.append(
            f'<g data-limit="{html.escape(one.title)}">'
            f'<text x="{x}" y="{y:.0f}" fill="currentColor"{bold}>{html.escape(one.title)} '
            f"<title>{html.escape(wheel)}</title></text>"
            f'<text x="{x + width}" y="{y:.0f}" text-anchor="end" fill="currentColor" '
            f'font-weight="bold">{html.escape(one.value)}</text>'
            f'<text x="{x + width}" y="{y + 13:.0f}" text-anchor="end" fill="currentColor" '
            f'opacity=".75">{html.escape(one.bound)}</text>'
            f'<rect x="{x}" y="{y + 6:.0f}" width="{LIST_BAR}" height="6" fill="none" '
            'stroke="#bbb"/>'
            f'<rect x="{x}" y="{y + 6:.0f}" width="{LIST_BAR * share:.1f}" height="6" '
            f'fill="{colour}"/></g>'
        )
    return "".join(parts)


def write(value: float, digits: int) -> str:
    """Return a number as text, ? for NaN."""
    return "?" if math.isnan(value) else f"{value:.{digits}f}"
