"""The dashboard, after the paper's Figure 5: the rover from above, with bars and numbers."""

import html
import math
from collections.abc import Sequence

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.viewer.state.colours import (
    LOAD,
    NOTICE,
    PASSABLE,
    REFUSED,
    TRACTION,
    UNKNOWN,
    colour_utilisation,
    to_css,
)
from rover_planner.viewer.state.comparison import POLICY_TITLES, PolicyVerdict
from rover_planner.viewer.state.trajectory import RoverState

WIDTH, HEIGHT = 330, 250
"""Size of the drawing [px]."""
BAR_HEIGHT = 44.0
"""Height of a full bar [px]."""
COLUMNS = {"left": 84.0, "right": 246.0}
ROWS = {"front": 40.0, "middle": 122.0, "rear": 204.0}
"""Centres of the wheels in the drawing [px], across and down."""
MAX_MARGIN = 1.2
"""Stability margin at the end of the gauge."""


def draw_dashboard(rover: Rover, state: RoverState, status: str) -> str:
    """Return the dashboard as HTML: wheels from above, turned as steered, the front at the top.

    Beside each wheel are bars of its torque saturation and its slip ratio, below it its normal
    force; the wheel's colour is its friction utilisation.

    Args:
        rover: The rover, for its limits.
        state: The values to show.
        status: What the page does, such as "paused".
    """
    parts = [_body()]
    for wheel, name in enumerate(WHEELS):
        position, side = name.rsplit("_", 1)
        parts.append(_wheel(state, wheel, COLUMNS[side], ROWS[position], side))
    parts.append(_gauge(state.tip_over_ratio, rover.limits.tip_over_ratio))
    picture = (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" '
        f'aria-label="rover from above" font-family="sans-serif" font-size="10">'
        f"{''.join(parts)}</svg>"
    )
    numbers = _numbers(state, status)
    return f'<div id="dashboard" style="padding:0 8px">{picture}{_legend()}{numbers}</div>'


def _body() -> str:
    return (
        '<rect x="132" y="44" width="66" height="164" rx="8" fill="#eee8d8" stroke="#888"/>'
        '<path d="M165 52 l10 16 h-20 z" fill="#888"/>'
        '<text x="165" y="82" text-anchor="middle" fill="#555">front</text>'
        '<g stroke="#888" stroke-width="3">'
        '<line x1="98" y1="128" x2="132" y2="128"/><line x1="198" y1="128" x2="232" y2="128"/></g>'
    )


def _wheel(state: RoverState, wheel: int, x: float, y: float, side: str) -> str:
    """Draw a wheel with its centre at x, y [px], and its bars on the outer side."""
    utilisation = float(state.friction_utilisation[wheel])
    bars = x - 45.0 if side == "left" else x + 17.0
    load = float(state.wheel_loads[wheel])
    angle = math.degrees(float(state.steering_angle[wheel]))
    turned = f", turned {angle:.0f} deg" if abs(angle) >= 0.5 else ""
    return (
        f'<rect x="{x - 11:.0f}" y="{y - 26:.0f}" width="22" height="52" rx="5" '
        f'transform="rotate({-angle:.1f} {x:.0f} {y:.0f})" '
        f'fill="{to_css(colour_utilisation(utilisation))}" stroke="#333">'
        f"<title>{WHEELS[wheel]}: friction utilisation {_number(utilisation, 2)}{turned}"
        "</title></rect>"
        + _bar(bars, y, float(state.torque_saturation[wheel]), to_css(LOAD), "torque saturation")
        + _bar(bars + 16, y, abs(float(state.slip_ratio[wheel])), to_css(TRACTION), "slip ratio")
        + f'<text x="{x:.0f}" y="{y + 38:.0f}" text-anchor="middle" fill="currentColor">'
        f"{_number(load, 1)} N</text>"
    )


def _bar(x: float, y: float, share: float, colour: str, name: str) -> str:
    """Draw a bar of a share of 1 with its left edge at x and its middle at y [px]."""
    height = BAR_HEIGHT * min(max(np.nan_to_num(share), 0.0), 1.0)
    top, bottom = y - BAR_HEIGHT / 2, y + BAR_HEIGHT / 2
    over = f' stroke="{to_css(REFUSED)}" stroke-width="2"' if share > 1.0 else ' stroke="#999"'
    return (
        f'<rect x="{x:.0f}" y="{top:.1f}" width="12" height="{BAR_HEIGHT}" fill="none"{over}>'
        f"<title>{name} {_number(share, 2)}</title></rect>"
        f'<rect x="{x:.0f}" y="{bottom - height:.1f}" width="12" height="{height:.1f}" '
        f'fill="{colour}"/>'
        f'<text x="{x + 6:.0f}" y="{top - 3:.0f}" text-anchor="middle" font-size="8" '
        f'fill="currentColor">{_short(share)}</text>'
    )


def _short(share: float) -> str:
    if math.isnan(share):
        return "?"
    return f"{share:.2f}".lstrip("0") if share < 1.0 else f"{min(share, 99.0):.1f}"


def _gauge(ratio: float, limit: float) -> str:
    """Draw the stability margin on a half circle from 0 to MAX_MARGIN, with its limit."""
    x, y, radius = 165.0, 172.0, 26.0

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
        f'<text x="{x}" y="{y + 12}" text-anchor="middle" fill="#333">{_number(ratio, 2)}</text>'
        f'<text x="{x}" y="{y + 24}" text-anchor="middle" font-size="8" fill="#333">'
        "stability margin</text>"
    )


def _legend() -> str:
    def key(colour: tuple[int, int, int], text: str) -> str:
        box = f'<span style="background:{to_css(colour)};padding:0 .5em">&nbsp;</span>'
        return f"{box}&nbsp;{html.escape(text)}&emsp;"

    ends = "".join(
        f'<span style="background:{to_css(colour)};padding:0 .4em">&nbsp;</span>'
        for colour in map(colour_utilisation, (0.0, 0.25, 0.5, 0.75, 1.0))
    )
    return (
        f'<div style="font-size:11px;line-height:1.5">{key(LOAD, "torque saturation")}'
        f"{key(TRACTION, 'slip ratio')}<br>wheels: friction utilisation 0 {ends} 1</div>"
    )


def _numbers(state: RoverState, status: str) -> str:
    rows = (
        ("Time", f"{state.time:.1f} s"),
        ("Distance", f"{100.0 * state.distance:.1f} cm"),
        ("Energy", f"{state.energy:.2f} J"),
        ("Speed", f"{100.0 * state.speed:.1f} cm/s"),
        ("Belly clearance", _centimetres(state.belly_clearance)),
        ("Tilt", f"{math.degrees(_tilt(state)):.1f} deg"),
    )
    cells = "".join(
        f'<div><span style="opacity:.7">{name}</span> <b>{value}</b></div>' for name, value in rows
    )
    return (
        '<div style="display:grid;grid-template-columns:1fr 1fr;font-size:13px;'
        f'line-height:1.5;margin-top:.3em">{cells}</div>'
        f'<div id="status" style="font-size:13px">{html.escape(status)}</div>'
    )


def _number(value: float, digits: int) -> str:
    return "?" if math.isnan(value) else f"{value:.{digits}f}"


def _centimetres(length: float) -> str:
    return f"{100.0 * length:.1f} cm" if math.isfinite(length) else "not known"


def _tilt(state: RoverState) -> float:
    """Return the angle between the body's z axis and the vertical [rad]."""
    roll, pitch, _ = state.attitude
    return math.acos(min(max(math.cos(roll) * math.cos(pitch), -1.0), 1.0))


def draw_empty_dashboard(status: str) -> str:
    """Return the dashboard, as HTML, of a rover without a state."""
    return (
        f'<div id="dashboard"><div id="status" style="padding:8px">{html.escape(status)}</div>'
        "</div>"
    )


def describe_verdict(
    traversable: bool | None,
    reason: str,
    refusal: str,
    summary: str,
    by_policy: Sequence[PolicyVerdict] = (),
    old: str = "",
) -> str:
    """Return a verdict as HTML.

    Args:
        traversable: The verdict; None if there is none.
        reason: The reason of the verdict, or a hint; empty for none.
        refusal: Why the last change was refused, empty if it was not.
        summary: What was judged and how long that took, empty for none.
        by_policy: The verdicts under all torque policies, side by side below it.
        old: Why this is a verdict on old values, which is greyed; empty if it is not.
    """
    colour = to_css(UNKNOWN if traversable is None else PASSABLE if traversable else REFUSED)
    word = {None: "no verdict", True: "traversable", False: "not traversable"}[traversable]
    text = f"<b>{word}</b>" + (f": {html.escape(reason)}" if reason else "")
    lines = [f'<div style="border-left:5px solid {colour};padding-left:.5em">{text}</div>']
    if by_policy:
        lines.append(_compare_policies(by_policy))
    if old:
        faded = f'<div id="old" style="opacity:.45;filter:grayscale(1)">{"".join(lines)}</div>'
        lines = [faded, f"<div><b>old values</b>: {html.escape(old)}</div>"]
    if refusal:
        lines.append(
            f'<div id="refusal" style="border-left:5px solid {to_css(NOTICE)};padding-left:.5em">'
            f"refused: {html.escape(refusal)}</div>"
        )
    if summary:
        lines.append(f'<div style="opacity:.7;font-size:11px">{html.escape(summary)}</div>')
    return f'<div id="verdict" style="font-size:13px;padding:0 8px">{"".join(lines)}</div>'


def _compare_policies(by_policy: Sequence[PolicyVerdict]) -> str:
    """Return a box for each policy, with its reason as a tool tip."""
    boxes = []
    for one in by_policy:
        known = one.traversable is not None
        faded = "opacity:.45;" if one.is_old else ""
        colour = (PASSABLE if one.traversable else REFUSED) if known else UNKNOWN
        word = ("passes" if one.traversable else "refused") if known else "not judged"
        boxes.append(
            f'<div title="{html.escape(one.reason or word)}" '
            f'style="{faded}border-top:4px solid {to_css(colour)};padding:.1em .3em">'
            f"{POLICY_TITLES[one.policy]}<br><b>{word}</b></div>"
        )
    return (
        '<div id="policies" style="display:grid;grid-template-columns:1fr 1fr 1fr;gap:.4em;'
        f'font-size:11px;margin-top:.3em">{"".join(boxes)}</div>'
    )
