# SPDX-License-Identifier: Apache-2.0
"""What is shown as a link or a file, and what a link holds as a scenario."""

import base64
import dataclasses
import html
import json
import platform
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Annotated, Any
from urllib.parse import parse_qs

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

import rover_physics
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict
from rover_physics.terrain.soil_file import soil_named
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import write_rover
from rover_planner.viewer.front.channel import read_file
from rover_planner.viewer.state.layers import Colouring
from rover_planner.viewer.state.scenario import Pose, Scenario

KEY = "view"
"""Key of a link in the query of an address."""
MAX_LENGTH = 8000
"""Most characters of a link; servers accept hardly more."""
MAX_TEXT = 200_000
"""Most bytes that are unpacked; a few letters can hold far more."""
PACKAGES = ("numpy", "scipy", "numba", "viser")
SCENE_TAG = '<iframe id="scene" title="scene"></iframe>'
STYLE_TAG = '<link rel="stylesheet" href="page.css">'
CODE_TAG = '<script type="module" src="page.js"></script>'
"""Lines of page.html for which a file that is sent has the contents."""


@dataclass(frozen=True, kw_only=True)
class PageLink(Colouring):
    """Content of a link to the page: what colours the ground, and what follows."""

    __pydantic_config__ = ConfigDict(allow_inf_nan=False, extra="forbid")

    loaded: Mapping[str, Any]
    """Content of the file of the rover as it was loaded."""
    rover: Mapping[str, Any]
    """The same with its numbers as they were changed since."""
    ground: str
    """Fingerprint of the map."""
    start: Pose
    """x, y [m] and yaw [rad], map frame."""
    goal: Pose
    """The same."""
    policy: str
    """Torque policy."""
    soil: str
    """Preset soil; empty for none."""
    path: Annotated[int, Field(ge=1)]
    """Number of the path that is looked at, from 1."""
    time: float
    """Time of the drive [s]."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Angles of the arm's joints by name [rad]."""


LINK = TypeAdapter(PageLink)


def write_link(link: PageLink) -> str:
    """Return a link as the query of an address: compressed JSON in letters that it may hold.

    It is empty if it would have more than MAX_LENGTH characters.
    """
    packed = base64.urlsafe_b64encode(zlib.compress(LINK.dump_json(link), 9))
    query = f"{KEY}={packed.decode().rstrip('=')}"
    return query if len(query) < MAX_LENGTH else ""


def read_link(query: str) -> PageLink | None:
    """Return what the query of an address holds; None if it is not one of `write_link`.

    Raises:
        PlanningError: It is damaged, or a value is missing or invalid; the text names it.
    """
    packed = parse_qs(query[:MAX_LENGTH].removeprefix("?")).get(KEY, [""])[0]
    if not packed:
        return None
    unpacker = zlib.decompressobj()
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        text = unpacker.decompress(data, MAX_TEXT)
    except (ValueError, zlib.error) as error:
        raise PlanningError(f"the link is damaged ({error})") from error
    if not unpacker.eof:
        raise PlanningError(f"the link is cut off, or holds more than {MAX_TEXT} bytes")
    try:
        return LINK.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "it"
        raise PlanningError(f"the link is invalid: {where}: {first['msg']}") from None


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
    options = wanted.options.change(
        policy=link.policy, soil=link.soil or None, joint_angles=link.joints
    )
    if options.model.soil is not None:
        soil_named(options.model.soil)  # before the page shows it as chosen
    return dataclasses.replace(
        wanted,
        loaded=loaded,
        rover=rover,
        start=link.start,
        goal=link.goal,
        options=options,
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
    query, own = write_link(link), {"rover_planner": rover_physics.__version__}
    versions = own | {"python": platform.python_version()} | {p: version(p) for p in PACKAGES}
    written = {
        "versions": ", ".join(f"{name} {text}" for name, text in versions.items()),
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
