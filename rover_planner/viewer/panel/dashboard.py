# SPDX-License-Identifier: Apache-2.0
"""The dashboard: the board with its numbers, the verdict as text, and the ages of topics."""

import html
import math
from collections.abc import Sequence

from rover_physics.rover.model import Rover
from rover_planner.viewer.live.live_state import TopicAge
from rover_planner.viewer.panel.board import BoardNotes, draw_board, draw_legend
from rover_planner.viewer.state.colours import NOTICE, PASSABLE, REFUSED, UNKNOWN, to_css
from rover_planner.viewer.state.context import POLICY_TITLES
from rover_planner.viewer.state.failure import Failure
from rover_planner.viewer.state.scenario import PolicyVerdict
from rover_planner.viewer.state.trajectory import RoverState


def draw_dashboard(
    rover: Rover, state: RoverState, status: str, notes: BoardNotes | None = None
) -> str:
    """Return the dashboard as HTML: the board, its legend, numbers, and what the page does.

    Args:
        rover: The rover, for its limits.
        state: The values to show.
        status: What the page does, such as "paused".
        notes: What else the board shows (default: slip, nothing else).
    """
    notes = notes or BoardNotes()
    return (
        f'<div id="dashboard" style="padding:0 8px">{draw_board(rover, state, notes)}'
        f"{draw_legend(notes)}{_numbers(state, status)}</div>"
    )


def _numbers(state: RoverState, status: str) -> str:
    rows = (
        ("Time", f"{state.time:.1f} s"),
        ("Distance", f"{100.0 * state.distance:.1f} cm"),
        ("Speed", f"{100.0 * state.speed:.1f} cm/s"),
        ("Tilt", f"{math.degrees(_tilt(state)):.1f} deg"),
        ("Energy", f"{state.energy:.2f} J"),
        ("Belly", _centimetres(state.belly_clearance)),
    )
    cells = "".join(
        f'<div style="white-space:nowrap"><span style="opacity:.7">{name}</span> '
        f"<b>{value}</b></div>"
        for name, value in rows
    )
    return (
        '<div style="display:grid;grid-template-columns:repeat(3,auto);column-gap:1em;'
        f'font-size:12px;line-height:1.5;margin-top:.3em">{cells}</div>'
        f'<div id="status" style="font-size:12px;line-height:1.5">{html.escape(status)}</div>'
    )


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
    notes: Sequence[str] = (),
    failure: str = "",
) -> str:
    """Return a verdict as HTML.

    Args:
        traversable: The verdict; None if there is none.
        reason: The reason of the verdict, or a hint; empty for none.
        refusal: Why the last change was refused, empty if it was not.
        summary: What was judged and how long that took, empty for none.
        by_policy: The verdicts under all torque policies, side by side below it.
        old: Why this is a verdict on old values, which is greyed; empty if it is not.
        notes: Sentences on what the verdict took into account.
        failure: What fails and where, HTML, which is shown instead of the reason; empty for none.
    """
    colour = to_css(UNKNOWN if traversable is None else PASSABLE if traversable else REFUSED)
    word = {None: "no verdict", True: "traversable", False: "not traversable"}[traversable]
    why = failure or html.escape(reason)
    text = f"<b>{word}</b>" + (f": {why}" if why else "")
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
    lines += _describe_notes(notes, summary)
    return (
        '<div id="verdict" style="font-size:13px;line-height:1.4;padding:0 8px">'
        f"{''.join(lines)}</div>"
    )


def describe_details(reason: str, summary: str, notes: Sequence[str]) -> str:
    """Return what stands below the board, as HTML: the whole reason, notes and summary."""
    lines = [f"<div>{html.escape(reason)}</div>"] if reason else []
    lines += _describe_notes(notes, summary)
    style = "font-size:12px;line-height:1.35;padding:4px 8px 0"
    return f'<div id="details" style="{style}">{"".join(lines)}</div>'


def describe_failure(failure: Failure) -> str:
    """Return a failure as HTML: limit, value, link and place."""
    between = ", between waypoints" if failure.is_between else ""
    return (
        f'<span id="failure"><b>{html.escape(failure.headline)}</b>, '
        f"after {failure.distance:.2f} m, {failure.time:.0f} s{between}</span>"
    )


def draw_topics(ages: Sequence[TopicAge]) -> str:
    """Return the topics of a live rover with their ages as HTML; stale ones are grey."""
    rows = "".join(
        f'<div data-topic="{html.escape(one.topic)}" data-stale="{str(one.is_stale).lower()}" '
        f'style="display:flex;justify-content:space-between;gap:1em;'
        f'{"opacity:.45;filter:grayscale(1)" if one.is_stale else ""}">'
        f"<span>{html.escape(one.topic)}</span>"
        f"<span>{'stale, ' if one.is_stale else ''}{one.describe()}</span></div>"
        for one in ages
    )
    return (
        '<div id="topics" style="font-size:12px;line-height:1.4;padding:4px 8px">'
        f'<div style="border-top:1px solid {to_css(NOTICE)};opacity:.7">'
        f"age of the last message</div>{rows}</div>"
    )


def _describe_notes(notes: Sequence[str], summary: str) -> list[str]:
    lines = [
        f'<div class="note" style="font-size:11px;line-height:1.3">{html.escape(note)}</div>'
        for note in notes
    ]
    if summary:
        lines.append(f'<div style="opacity:.7;font-size:11px">{html.escape(summary)}</div>')
    return lines


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
