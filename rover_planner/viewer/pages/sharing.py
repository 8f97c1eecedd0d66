# SPDX-License-Identifier: Apache-2.0
"""What is shown as a link or a file, and what a link holds as a scenario."""

import dataclasses
import html
import json
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import rover_physics
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict
from rover_physics.terrain.soil_file import soil_named
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import write_rover
from rover_planner.viewer.front.channel import read_file
from rover_planner.viewer.state.layers import Colouring
from rover_planner.viewer.state.link import PageLink, write_link
from rover_planner.viewer.state.scenario import Scenario, Shown

PACKAGES = ("numpy", "scipy", "numba", "viser")
SCENE_TAG = '<iframe id="scene" title="scene"></iframe>'
STYLE_TAG = '<link rel="stylesheet" href="page.css">'
CODE_TAG = '<script type="module" src="page.js"></script>'
"""Lines of page.html for which a file that is sent has the contents."""


def make_link(shown: Shown, ground: str, time: float, colouring: Colouring) -> PageLink:
    """Return the link to what is shown.

    Args:
        shown: What is shown.
        ground: Fingerprint of the map.
        time: Time of the drive [s].
        colouring: What the ground is coloured by.
    """
    now = shown.scenario
    return PageLink(
        loaded=rover_to_dict(now.loaded),
        rover=rover_to_dict(now.rover),
        ground=ground,
        start=now.start,
        goal=now.goal,
        policy=now.options.model.policy,
        soil=now.options.model.soil or "",
        path=shown.index + 1,
        time=time,
        joints=dict(now.arm_angles),
        **dataclasses.asdict(colouring),
    )


def read_scenario(link: PageLink, wanted: Scenario, ground: str) -> Scenario:
    """Return what a link asks for, on the ground of the scenario that is wanted.

    Raises:
        RoverError, PlanningError: It is about another map or rover, or a value is invalid.
    """
    if link.ground != ground:
        raise PlanningError("the link is about another map than this page shows")
    loaded, rover = (
        rover_from_dict(dict(one), "the rover in the link") for one in (link.loaded, link.rover)
    )
    if loaded == wanted.loaded:
        loaded = wanted.loaded
    known = () if loaded.manipulator is None else loaded.manipulator.joints
    for joint in link.joints:
        if joint not in known:
            raise PlanningError(f"the link turns the joint {joint!r}, which {loaded.name} lacks")
    same = (link.start, link.goal) == (wanted.start, wanted.goal)
    options = wanted.options.change(policy=link.policy, soil=link.soil or None)
    if options.model.soil is not None:
        soil_named(options.model.soil)  # before the page shows it as chosen
    return dataclasses.replace(
        wanted,
        loaded=loaded,
        rover=rover,
        start=link.start,
        goal=link.goal,
        options=options,
        arm_angles=dict(link.joints),
        recorded=wanted.recorded if same else None,
    )


def write_file(
    server: Any, parts: Mapping[str, Any], link: PageLink, rover: Rover, base: str
) -> str:
    """Return the page as it is as one HTML file that needs neither network nor program.

    Args:
        server: The server of viser, from whose last visitor's camera the file looks.
        parts: All parts that are shown.
        link: The link to what is shown.
        rover: The rover, whose file is added.
        base: Address of the page, such as http://localhost:8080.
    """
    for client in server.get_clients().values():
        server.initial_camera.position = client.camera.position
        server.initial_camera.look_at = client.camera.look_at
    try:
        query = write_link(link)
    except PlanningError:  # it would be too long; the file has the rover itself
        query = ""
    written = {
        "versions": _versions(),
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "link": f"{base}/?{query}" if query else "",
        "rover": write_rover(rover),
    }
    told = json.dumps({**parts, "written": written}).replace("<", "\\u003c")
    scene = html.escape(server.get_scene_serializer().as_html(), quote=True)
    page = read_file("page.html")
    page = page.replace(SCENE_TAG, f'<iframe id="scene" title="scene" srcdoc="{scene}"></iframe>')
    page = page.replace(STYLE_TAG, f"<style>{read_file('page.css')}</style>")
    code = f'<script type="module">{read_file("page.js")}</script>'
    return page.replace(
        CODE_TAG, f'<script id="told" type="application/json">{told}</script>{code}'
    )


def _versions() -> str:
    own = {"rover_planner": rover_physics.__version__, "python": platform.python_version()}
    found = own | {name: version(name) for name in PACKAGES}
    return ", ".join(f"{name} {text}" for name, text in found.items())
