"""The board of the page, after the paper's Figure 5: the rover from above, bars and numbers."""

import html
import math

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.colours import (
    LOAD,
    NOTE,
    PASSABLE,
    PULL,
    REFUSED,
    UNKNOWN,
    css,
    of_use,
)
from rover_planner.viewer.state.journey import Frame

WIDTH, HEIGHT = 330, 250
BAR = 44.0
"""Height of a full bar [px]."""
COLUMNS = {"left": 84.0, "right": 246.0}
ROWS = {"front": 40.0, "middle": 122.0, "rear": 204.0}


def draw_board(rover: Rover, frame: Frame, state: str) -> str:
    """Return the board as HTML: wheels from above, the front at the top.

    Beside each wheel are bars of its torque saturation and its slip ratio, below it its normal
    force; the wheel's colour is its friction utilisation. `state` says whether it plays.
    """
    parts = [_body()]
    for wheel, name in enumerate(WHEELS):
        place, side = name.rsplit("_", 1)
        parts.append(_wheel(frame, wheel, COLUMNS[side], ROWS[place], side))
    parts.append(_gauge(frame.tip_over_ratio, rover.limits.tip_over_ratio))
    picture = (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" '
        f'aria-label="rover from above" font-family="sans-serif" font-size="10">'
        f"{''.join(parts)}</svg>"
    )
    return (
        f'<div id="board" style="padding:0 8px">{picture}{_legend()}{_numbers(frame, state)}</div>'
    )


def _body() -> str:
    return (
        '<rect x="132" y="44" width="66" height="164" rx="8" fill="#eee8d8" stroke="#888"/>'
        '<path d="M165 52 l10 16 h-20 z" fill="#888"/>'
        '<text x="165" y="82" text-anchor="middle" fill="#555">front</text>'
        '<g stroke="#888" stroke-width="3">'
        '<line x1="98" y1="128" x2="132" y2="128"/><line x1="198" y1="128" x2="232" y2="128"/></g>'
    )


def _wheel(frame: Frame, wheel: int, x: float, y: float, side: str) -> str:
    use = float(frame.friction_utilisation[wheel])
    bars = x - 45.0 if side == "left" else x + 17.0
    load = float(frame.wheel_loads[wheel])
    return (
        f'<rect x="{x - 11:.0f}" y="{y - 26:.0f}" width="22" height="52" rx="5" '
        f'fill="{css(of_use(use))}" stroke="#333"><title>{WHEELS[wheel]}: friction utilisation '
        f"{_number(use, 2)}</title></rect>"
        + _bar(bars, y, float(frame.torque_saturation[wheel]), css(LOAD), "torque saturation")
        + _bar(bars + 16, y, abs(float(frame.slip_ratio[wheel])), css(PULL), "slip ratio")
        + f'<text x="{x:.0f}" y="{y + 38:.0f}" text-anchor="middle" fill="currentColor">'
        f"{_number(load, 1)} N</text>"
    )


def _bar(x: float, y: float, share: float, colour: str, what: str) -> str:
    height = BAR * min(max(np.nan_to_num(share), 0.0), 1.0)
    over = f' stroke="{css(REFUSED)}" stroke-width="2"' if share > 1.0 else ' stroke="#999"'
    return (
        f'<rect x="{x:.0f}" y="{y - BAR / 2:.1f}" width="12" height="{BAR}" fill="none"{over}>'
        f"<title>{what} {_number(share, 2)}</title></rect>"
        f'<rect x="{x:.0f}" y="{y + BAR / 2 - height:.1f}" width="12" height="{height:.1f}" '
        f'fill="{colour}"/>'
        f'<text x="{x + 6:.0f}" y="{y - BAR / 2 - 3:.0f}" text-anchor="middle" font-size="8" '
        f'fill="currentColor">{_short(share)}</text>'
    )


def _short(share: float) -> str:
    if math.isnan(share):
        return "?"
    return f"{share:.2f}".lstrip("0") if share < 1.0 else f"{min(share, 99.0):.1f}"


def _gauge(ratio: float, limit: float) -> str:
    """Draw the stability margin on a half circle from 0 to 1.2, with its limit."""
    x, y, radius, most = 165.0, 172.0, 26.0, 1.2

    def point(value: float, r: float) -> tuple[float, float]:
        angle = math.pi * (1.0 - min(max(value, 0.0), most) / most)
        return x + r * math.cos(angle), y - r * math.sin(angle)

    def arc(start: float, end: float, colour: str) -> str:
        (ax, ay), (bx, by) = point(start, radius), point(end, radius)
        return (
            f'<path d="M{ax:.1f} {ay:.1f} A{radius} {radius} 0 0 1 {bx:.1f} {by:.1f}" '
            f'fill="none" stroke="{colour}" stroke-width="6"/>'
        )

    tip_x, tip_y = point(0.0 if math.isnan(ratio) else ratio, radius - 2)
    return (
        arc(0.0, limit, css(REFUSED))
        + arc(limit, most, css(PASSABLE))
        + f'<line x1="{x}" y1="{y}" x2="{tip_x:.1f}" y2="{tip_y:.1f}" stroke="#222" '
        'stroke-width="2.5"/>'
        f'<text x="{x}" y="{y + 12}" text-anchor="middle" fill="#333">{_number(ratio, 2)}</text>'
        f'<text x="{x}" y="{y + 24}" text-anchor="middle" font-size="8" fill="#333">'
        "stability margin</text>"
    )


def _legend() -> str:
    def key(colour: tuple[int, int, int], text: str) -> str:
        box = f'<span style="background:{css(colour)};padding:0 .5em">&nbsp;</span>'
        return f"{box}&nbsp;{html.escape(text)}&emsp;"

    ends = "".join(
        f'<span style="background:{css(of_use(share))};padding:0 .4em">&nbsp;</span>'
        for share in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    return (
        f'<div style="font-size:11px;line-height:1.5">{key(LOAD, "torque saturation")}'
        f"{key(PULL, 'slip ratio')}<br>wheels: friction utilisation 0 {ends} 1</div>"
    )


def _numbers(frame: Frame, state: str) -> str:
    rows = (
        ("Time", f"{frame.time:.1f} s"),
        ("Distance", f"{100.0 * frame.distance:.1f} cm"),
        ("Energy", f"{frame.energy:.2f} J"),
        ("Speed", f"{100.0 * frame.speed:.1f} cm/s"),
        ("Belly clearance", _centimetres(frame.belly_clearance)),
        ("Tilt", f"{math.degrees(_tilt(frame)):.1f} deg"),
    )
    cells = "".join(
        f'<div><span style="opacity:.7">{name}</span> <b>{value}</b></div>' for name, value in rows
    )
    return (
        '<div style="display:grid;grid-template-columns:1fr 1fr;font-size:13px;'
        f'line-height:1.5;margin-top:.3em">{cells}</div>'
        f'<div id="state" style="font-size:13px">{html.escape(state)}</div>'
    )


def _number(value: float, digits: int) -> str:
    return "?" if math.isnan(value) else f"{value:.{digits}f}"


def _centimetres(length: float) -> str:
    return f"{100.0 * length:.1f} cm" if math.isfinite(length) else "not known"


def _tilt(frame: Frame) -> float:
    roll, pitch, _ = frame.attitude
    return math.acos(min(max(math.cos(roll) * math.cos(pitch), -1.0), 1.0))


def say_nothing_to_show(state: str) -> str:
    """Return the board for a rover that stands nowhere, and what is waited for."""
    return f'<div id="board"><div id="state" style="padding:8px">{html.escape(state)}</div></div>'


def describe_verdict(traversable: bool | None, reason: str, refusal: str, judged: str) -> str:
    """Return a verdict as HTML.

    Args:
        traversable: The verdict, None where there is none.
        reason: Why, or what else there is to say.
        refusal: Why the last change was refused, empty if it was not.
        judged: What was judged, and how long that took.
    """
    colour = css(UNKNOWN if traversable is None else PASSABLE if traversable else REFUSED)
    word = {None: "no verdict", True: "traversable", False: "not traversable"}[traversable]
    text = f"<b>{word}</b>" + (f": {html.escape(reason)}" if reason else "")
    lines = [f'<div style="border-left:5px solid {colour};padding-left:.5em">{text}</div>']
    if refusal:
        lines.append(
            f'<div id="refusal" style="border-left:5px solid {css(NOTE)};padding-left:.5em">'
            f"refused: {html.escape(refusal)}</div>"
        )
    if judged:
        lines.append(f'<div style="opacity:.7;font-size:11px">{html.escape(judged)}</div>')
    return f'<div id="verdict" style="font-size:13px;padding:0 8px">{"".join(lines)}</div>'
