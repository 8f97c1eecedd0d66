# SPDX-License-Identifier: Apache-2.0
"""A page that is sent: one HTML file with the scene, verdict, failing pose, numbers, versions."""

import html
import platform
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

import rover_physics
from rover_physics.names import WHEELS
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_planner.studies.rover_values import write_rover
from rover_planner.viewer.state.context import Context
from rover_planner.viewer.state.scenario import Shown

PACKAGES = ("numpy", "scipy", "numba", "viser")
WHEEL_ROWS = {
    "normal force N [N]": ("wheel_loads", 1),
    "traction T [N]": ("tangential", 1),
    "lateral force S [N]": ("lateral", 1),
    "friction utilisation": ("friction_utilisation", 2),
    "torque saturation": ("torque_saturation", 2),
    "slip ratio": ("slip_ratio", 2),
    "sinkage [mm]": ("sinkage", 1),
}
"""Rows of the table of wheels: field of the prediction and digits."""
MILLI = 1e3
STYLE = """
#report { position: fixed; top: 0; left: 0; bottom: 0; width: 34em; overflow: auto; z-index: 10;
  background: rgba(255, 255, 255, .92); padding: .5em 1em; font: 13px/1.4 sans-serif;
  box-sizing: border-box; color: #222; }
#report th { text-align: left; vertical-align: top; padding-right: .8em; font-weight: normal;
  opacity: .7; }
#report td { padding-right: .6em; overflow-wrap: anywhere; }
#report h1 { font-size: 1.5em; }
#report #wheels th { white-space: nowrap; }
#report #wheels td { text-align: right; }
@media (max-width: 1000px) { #report { top: auto; right: 0; width: auto; height: 45%; } }
"""
VISERS_TITLE = re.compile("<title>.*?</title>")
"""The title that viser gives a file; a browser shows the first one."""


def write_page(server: Any, camera: Any, report: str, title: str) -> bytes:
    """Return the scene and a report as one HTML file that needs no network.

    Args:
        server: The server of viser.
        camera: The camera of the visitor, from which the file looks at first.
        report: The report, HTML.
        title: Title of the file, text.
    """
    server.initial_camera.position = camera.position
    server.initial_camera.look_at = camera.look_at
    safe = html.escape(title)
    page: str = server.get_scene_serializer().as_html()
    page = VISERS_TITLE.sub(lambda _found: f"<title>{safe}</title>", page, count=1)
    inserted = f'<style>{STYLE}</style><div id="report"><h1>{safe}</h1>{report}</div>'
    at = page.rindex("</body>")
    return (page[:at] + inserted + page[at:]).encode()


def describe_judgement(shown: Shown, context: Context, query: str) -> str:
    """Return the verdict on the shown path with its numbers as HTML.

    Args:
        shown: What is shown.
        context: What it is about.
        query: The link to it, as `write_link` returns it; empty if it would be too long.
    """
    scenario = shown.scenario
    verdict, prediction = shown.verdict, shown.candidate.prediction
    facts = {
        "rover": context.rover,
        "map": f"{context.ground}, {scenario.terrain.elevation.shape[1]} x "
        f"{scenario.terrain.elevation.shape[0]} cells of {scenario.terrain.resolution:g} m",
        "soil": context.soil,
        "torques": context.policy,
        "start": _pose(scenario.start),
        "goal": _pose(scenario.goal),
        "path": f"{shown.index + 1} of {len(shown.answer.candidates)}, "
        f"{shown.candidate.length:.2f} m",
        "largest friction utilisation": _number(verdict.max_friction_utilisation, 2),
        "largest torque saturation": _number(verdict.max_torque_saturation, 2),
        "smallest stability margin": _number(verdict.min_tip_over_ratio, 2),
        "largest tilt": f"{_number(np.degrees(verdict.max_tilt), 1)} deg",
        "smallest belly clearance": f"{_number(MILLI * verdict.min_belly_clearance, 0)} mm",
        "versions": _versions(),
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "link": f"?{query}" if query else "too long; the rover file is below",
    }
    parts = []
    if shown.reason:
        parts.append(f'<p id="reason"><b>{html.escape(shown.reason)}</b></p>')
    if not verdict.traversable:
        parts.append(_failing_pose(scenario.rover, prediction, verdict.first_failure))
    parts += [f"<p>{html.escape(note)}</p>" for note in shown.trajectory.notes]
    parts.append(_list(facts))
    rover_file = html.escape(write_rover(scenario.rover))
    parts.append(f"<details><summary>rover file</summary><pre>{rover_file}</pre></details>")
    return "".join(parts)


def _failing_pose(rover: Rover, prediction: PathPrediction, waypoint: int) -> str:
    """Return where the path is refused, and a table of the wheels there."""
    part, row, where = _find_row(rover, prediction, waypoint)
    x, y, yaw = part.poses[row]
    facts = {
        "refused at": f"{where}, {prediction.distance[waypoint]:.2f} m from the start",
        "pose": _pose((x, y, yaw)),
    }
    if not part.settled[row]:
        return _list(facts) + "<p>The rover does not settle there.</p>"
    facts["roll and pitch"] = ", ".join(
        f"{np.degrees(angle):.1f} deg" for angle in (part.roll[row], part.pitch[row])
    )
    return _list(facts) + _wheel_table(part, row)


def _find_row(
    rover: Rover, prediction: PathPrediction, waypoint: int
) -> tuple[PathPrediction, int, str]:
    """Return the prediction and its row in which a waypoint's limit is broken, and its name."""
    between, limits = prediction.between, limits_of(rover, prediction.policy)
    passes = find_uses(limits, prediction.results).find_first()[waypoint] < 0
    if between is not None and passes:
        broken = find_uses(limits, between.results).find_first() >= 0
        rows = np.flatnonzero((between.waypoint == waypoint) & broken)
        if rows.size:
            return between, int(rows[0]), f"on the way to waypoint {waypoint}"
    return prediction, waypoint, f"waypoint {waypoint}"


def _wheel_table(part: PathPrediction, row: int) -> str:
    head = "".join(f"<th>{name.replace('_', ' ')}</th>" for name in WHEELS)
    lines = []
    for title, (field, digits) in WHEEL_ROWS.items():
        values = getattr(part, field)[row] * (MILLI if "[mm]" in title else 1.0)
        cells = "".join(f"<td>{_number(value, digits)}</td>" for value in values)
        lines.append(f"<tr><th>{title}</th>{cells}</tr>")
    return f'<table id="wheels"><tr><th></th>{head}</tr>{"".join(lines)}</table>'


def _number(value: float, digits: int) -> str:
    """Return a number with digits behind the point; "?" if it is not known."""
    if np.isnan(value):
        return "?"
    return f"{value:.{digits}f}" if np.isfinite(value) else "infinite"


def _list(facts: dict[str, str]) -> str:
    rows = "".join(
        f"<tr><th>{name}</th><td>{html.escape(text)}</td></tr>" for name, text in facts.items()
    )
    return f"<table>{rows}</table>"


def _pose(pose: Sequence[float]) -> str:
    x, y, yaw = pose
    return f"x {x:.3f} m, y {y:.3f} m, yaw {np.degrees(yaw):.1f} deg"


def _versions() -> str:
    found = {"rover_planner": rover_physics.__version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return ", ".join(f"{name} {text}" for name, text in found.items())
