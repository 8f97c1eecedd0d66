# SPDX-License-Identifier: Apache-2.0
"""Sends what the page shows as a file or a link, and shows again what a link holds."""

import dataclasses
import html
from typing import Any

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover, preset_names
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.soil_file import soil_named
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import read_rover, write_rover
from rover_planner.viewer.browser.link import (
    PageLink,
    change_values,
    fingerprint,
    list_changed_values,
    write_link,
)
from rover_planner.viewer.browser.report import describe_judgement, write_page
from rover_planner.viewer.panel.ground_tab import GroundTab
from rover_planner.viewer.state.context import describe_scenario
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.session import ViewSession
from rover_planner.viewer.state.visitor_requests import VisitorRequests

FILE_WORDS = (
    "One HTML file with the scene, the failing pose, all numbers and versions. It opens in any "
    "browser, without this program."
)
LINK_WORDS = (
    "A link to this page that holds rover (also one of a file), changed values, ends, path, time "
    "and colours."
)


class Sharing:
    """The tab to share what is shown: it writes and opens links, and writes files."""

    def __init__(
        self,
        server: Any,
        requests: VisitorRequests,
        session: ViewSession,
        playback: Playback,
        ground_tab: GroundTab,
    ):
        """Add buttons to the container that is open; no link is opened yet."""
        self._server, self._session, self._playback = server, session, playback
        self._ground_tab = ground_tab
        self._fingerprint: tuple[Terrain | None, str] = (None, "")
        self._opening: tuple[PageLink, Scenario] | None = None
        """The link whose path and time are not shown yet, and what it asks for."""
        gui = server.gui
        gui.add_html(_text(FILE_WORDS))
        save = gui.add_button("Save as HTML file")
        save.on_click(lambda event: requests.add(lambda: self._save(event.client)))
        gui.add_html(_text(LINK_WORDS))
        link = gui.add_button("Link to what is shown")
        link.on_click(lambda _event: requests.add(self._show_link))
        self._link = gui.add_html("")

    def _save(self, client: Any) -> None:
        """Send a visitor the scene and its report as one HTML file."""
        session, link = self._session, self.make_link()
        judgement = session.shown
        context = describe_scenario(judgement.scenario, session.ground_name)
        word = "traversable" if session.shown.verdict.traversable else "not traversable"
        title = f"{judgement.scenario.rover.name} on {context.ground}: {word}"
        try:
            query = write_link(link)
        except PlanningError:  # it would be too long; the report has the rover file itself
            query = ""
        report = describe_judgement(judgement, context, query)
        content = write_page(self._server, client.camera, report, title)
        name = f"{judgement.scenario.rover.name}_{word.replace(' ', '_')}.html"
        client.send_file_download(name, content, save_immediately=True)

    def _show_link(self) -> None:
        """Show the link, to open or to copy.

        Raises:
            PlanningError: It would be too long.
        """
        self._link.content = ""
        safe = html.escape(f"?{write_link(self.make_link())}", quote=True)
        copy = "navigator.clipboard.writeText(document.getElementById('link').href)"
        self._link.content = _text(
            f'<button onclick="{copy}">Copy</button> '
            f'<a id="link" href="{safe}" style="overflow-wrap:anywhere">{safe}</a>'
        )

    def make_link(self) -> PageLink:
        """Return the link to what is shown."""
        session, now = self._session, self._session.shown.scenario
        return PageLink(
            rover=now.loaded.name,
            ground=self._identify(now.terrain),
            start=now.start,
            goal=now.goal,
            policy=now.options.model.policy,
            soil=now.options.model.soil or "",
            path=session.shown.index + 1,
            time=round(self._playback.time, 3),
            layer=self._ground_tab.layer,
            heading=self._ground_tab.heading,
            values=list_changed_values(now.loaded, now.rover),
            joints=dict(now.arm_angles),
            along=self._ground_tab.is_along_path,
            rover_file="" if _is_preset(now.loaded) else write_rover(now.loaded),
        )

    def open(self, link: PageLink) -> None:
        """Judge what a link holds; `go_on` then shows its path and time.

        Raises:
            RoverError, PlanningError: It is about another map or rover, or a value is invalid.
        """
        wanted = self._session.wanted
        if link.ground != self._identify(wanted.terrain):
            raise PlanningError("the link is about another map than this page shows")
        if link.layer not in self._ground_tab.layers:
            raise PlanningError(f"the link names the layer {link.layer!r}, which there is not")
        asked = self._read(link, wanted)
        self._session.take_scenario(asked)
        self._ground_tab.choose_layer(link.layer, link.heading, along=link.along)
        self._opening = link, asked

    def _read(self, link: PageLink, wanted: Scenario) -> Scenario:
        loaded = _read_loaded(link)
        if loaded == wanted.loaded:
            loaded = wanted.loaded
        _check_joints(link, loaded)
        same = (link.start, link.goal) == (wanted.start, wanted.goal)
        options = wanted.options.change(policy=link.policy, soil=link.soil or None)
        if options.model.soil is not None:
            soil_named(options.model.soil)  # before the page shows it as chosen
        return dataclasses.replace(
            wanted,
            loaded=loaded,
            rover=change_values(loaded, link.values),
            start=link.start,
            goal=link.goal,
            options=options,
            arm_angles=dict(link.joints),
            recorded=wanted.recorded if same else None,
        )

    def go_on(self) -> None:
        """Show path and time of the link that was opened, as soon as they are judged.

        They are forgotten if the link was refused, or a visitor wants something else meanwhile.
        """
        session = self._session
        if self._opening is None:
            return
        link, asked = self._opening
        if session.wanted is not asked:
            self._opening = None
            return
        if session.is_outdated:
            return
        if session.shown.index == link.path - 1:
            self._opening = None
            self._playback.go_to(link.time)
        elif link.path <= len(session.shown.answer.candidates):
            session.show_candidate(link.path - 1)
        elif session.progress is None:  # no path around was found this time
            self._opening = None

    def _identify(self, terrain: Terrain) -> str:
        """Return the fingerprint of a map, which is computed once."""
        if self._fingerprint[0] is not terrain:
            self._fingerprint = terrain, fingerprint(terrain)
        return self._fingerprint[1]


def _text(text: str) -> str:
    return f'<div style="font-size:12px;padding:4px 8px">{text}</div>'


def _check_joints(link: PageLink, rover: Rover) -> None:
    """Check that the rover of a link has the joints that the link turns."""
    known = () if rover.manipulator is None else rover.manipulator.joints
    for joint in link.joints:
        if joint not in known:
            raise PlanningError(f"the link turns the joint {joint!r}, which {rover.name} lacks")


def _is_preset(rover: Rover) -> bool:
    return rover.name in preset_names() and load_rover(rover.name) == rover


def _read_loaded(link: PageLink) -> Rover:
    """Return the rover that was loaded when a link was made."""
    if link.rover_file:
        return read_rover(link.rover_file, "the rover file in the link")
    if link.rover not in preset_names():
        raise PlanningError(
            f"the link is about the rover {link.rover}, which is no preset; it has no file"
        )
    return load_rover(link.rover)
