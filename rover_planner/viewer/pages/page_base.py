# SPDX-License-Identifier: Apache-2.0
"""The base of every page: a viser server, its panels, and the one thread that changes them."""

import math
import threading
import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from rover_planner.errors import PlanningError
from rover_planner.viewer.browser import label_script, path_script, words
from rover_planner.viewer.browser.channel import run_script
from rover_planner.viewer.browser.link import Link, read_link
from rover_planner.viewer.browser.script import SCRIPT
from rover_planner.viewer.pages.drawings import Drawings
from rover_planner.viewer.pages.visitors import PANEL_WIDTH, PLOTS_WIDTH, Visitors
from rover_planner.viewer.panel.camera_buttons import CameraButtons
from rover_planner.viewer.panel.error_notice import ErrorNotice
from rover_planner.viewer.panel.header import Chip, Header
from rover_planner.viewer.panel.plots import Plots
from rover_planner.viewer.scene.cameras import VIEWS
from rover_planner.viewer.scene.ground_mesh import intersect_ground
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.context import Context
from rover_planner.viewer.state.session import REFUSALS, ViewSession
from rover_planner.viewer.state.visitor_requests import Action, VisitorRequests

PERIOD = 0.04
"""Time between two pictures [s]."""
RESTART = 1.0
"""Time until a stopped page starts again [s]."""


class PageBase(ABC):
    """A served page. Callbacks of the browser only add requests for the page's own thread.

    No error ends that thread. The page shows an error in a request and takes the next request. An
    error in a picture stops the pictures until the next request, or for `retry_after` [s]. After
    any other error the page says that it has stopped and why, and starts again by itself.
    """

    retry_after = math.inf
    """Time from an error in a picture to the next picture without a request [s]."""

    def __init__(self, session: ViewSession, host: str, port: int):
        """Start the server; `start` starts the thread.

        Args:
            session: The state to show.
            host: Address to serve on.
            port: Port to serve on; 0 takes a free one.
        """
        import viser

        self.session = session
        self.requests = VisitorRequests()
        self._ended = threading.Event()
        self._fulfils = False
        self._stopped_at: float | None = None
        """When an error stopped the pictures [s]; None while they go on."""
        self.server = viser.ViserServer(host, port, label="rover_planner", verbose=False)
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.scene = Scene(self.server)
        self.scene.frame.move_to(session.terrain)
        self._add_panels()
        for script in (SCRIPT, words.SCRIPT, label_script.SCRIPT, path_script.SCRIPT):
            run_script(self.server, script)
        self.server.on_client_connect(self._welcome)
        self.server.on_client_disconnect(self._forget)
        self.server.scene.on_click()(lambda event: self._request_click(event, False))
        self.server.scene.on_click(modifier="shift")(
            lambda event: self._request_click(event, True)
        )
        self._last = self._due = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    @property
    def is_drawing(self) -> bool:
        """Whether the page acts on requests, or has still to draw what they have changed."""
        return self._fulfils or self.drawings.waiting

    def start(self) -> None:
        """Start the thread that changes the page."""
        self._thread.start()

    def close(self) -> None:
        """End the page."""
        self._ended.set()
        self._thread.join(5.0)
        self.end_work()
        self.server.stop()

    def wait(self) -> None:
        """Serve until the page is closed or the program is interrupted."""
        while not self._ended.wait(0.5):
            pass

    def end_work(self) -> None:
        """End what the page does in other threads."""
        return

    def add_notices(self) -> None:
        """Add notices above the tabs."""
        return

    @abstractmethod
    def fill_panel(self, tabs: Any) -> None:
        """Add tabs to the main panel."""

    @abstractmethod
    def click(self, point: np.ndarray | None, shift: bool) -> None:
        """Act on a click at a point of the ground (2,) [m]; None beside known ground."""

    @abstractmethod
    def advance(self, seconds: float) -> None:
        """Draw the next picture, after a time of the visitor [s]."""

    def add_due_requests(self) -> None:
        """Add requests whose time has come; called in each period, with or without pictures."""
        return

    @abstractmethod
    def describe_context(self) -> tuple[Context, tuple[Chip, ...]]:
        """Return what the page is about, and the chips of its header; called in each period."""

    @abstractmethod
    def show_refusal(self, reason: str) -> None:
        """Show, as text, why a request was refused."""

    def _add_panels(self) -> None:
        gui = self.server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self.header = Header(gui)
        self.errors = ErrorNotice(gui)
        self.drawings = Drawings(self.errors, self.server.atomic)
        self.add_notices()
        self.camera_buttons = CameraButtons(
            gui,
            VIEWS,
            lambda client, view: self.requests.add(lambda: self._look(client, view)),
            lambda follows: self.requests.add(lambda: self._follow(follows)),
        )
        self.fill_panel(gui.add_tab_group())
        left = gui.add_panel()
        with left.add_tab("Limits and plots"):
            self.plots = Plots(gui)
        left.dock_left()
        left.set_width(PLOTS_WIDTH)
        self._visitors = Visitors(left, self._request_link)

    def _aim_camera(self, client: Any) -> None:
        session = self.session
        self.scene.aim_camera(
            client, session.rover, session.terrain, session.scenario.start, session.scenario.goal
        )

    def _welcome(self, client: Any) -> None:
        """Aim the camera of a new visitor, then fit the panels; it waits for the browser."""
        self._aim_camera(client)
        self._visitors.greet(client)

    def _forget(self, client: Any) -> None:
        self._visitors.forget(client)
        self.requests.add(lambda: self.scene.paths.forget(client))

    def open_link(self, link: Link) -> None:
        """Show what a link holds.

        Raises:
            RoverError, PlanningError: This page cannot show it.
        """
        raise PlanningError("this page follows a live rover, so it opens no links")

    def _request_link(self, query: str) -> None:
        def open_query() -> None:
            link = read_link(query)
            if link is not None:
                self.open_link(link)

        self.requests.add(open_query, "link")

    def _show_header(self) -> None:
        self.header.show(*self.describe_context())

    def _look(self, client: Any, view: str) -> None:
        self.scene.look(client, view, self.session.terrain, self.path_to_look_at())

    def _follow(self, follows: bool) -> None:
        self.scene.follow(follows)
        self.camera_buttons.show(follows)

    def path_to_look_at(self) -> np.ndarray:
        """Return x and y (n, 2) [m] of what a view of everything shows."""
        return np.array([self.session.scenario.start[:2], self.session.scenario.goal[:2]])

    def _request_click(self, event: Any, shift: bool) -> None:
        origin = self.scene.frame.to_map(event.ray_origin)
        direction = np.array(event.ray_direction)

        def click() -> None:
            self.click(intersect_ground(self.session.terrain, origin, direction), shift)

        self.requests.add(click, "click")

    def _run(self) -> None:
        while not self._ended.is_set():
            if not self.errors.run("stopped", self._run_period):
                self._ended.wait(RESTART)

    def _run_period(self) -> None:
        """Fulfil the requests, draw one of what waits, and draw the next picture when it is due.

        Without anything to draw, a picture follows the requests at once.
        """
        self.requests.wait(0.0 if self.drawings.waiting else self._due - time.monotonic())
        self.add_due_requests()
        self._fulfils = True
        for action in self.requests.take_all():
            self._fulfil(action)
        self._fulfils = False
        self.errors.run("the header is not shown", self._show_header)
        self.drawings.draw_next()
        now = time.monotonic()
        if self.drawings.waiting and now < self._due:
            return
        passed, self._last, self._due = now - self._last, now, now + PERIOD
        if self._stopped_at is None or now - self._stopped_at > self.retry_after:
            self._draw_picture(passed)

    def _fulfil(self, request: Action) -> None:
        """Act on a request; the pictures go on if an error had stopped them."""
        self.errors.run("the last request failed", lambda: self._act_or_refuse(request))
        self._stopped_at = None

    def _act_or_refuse(self, request: Action) -> None:
        try:
            request()
        except REFUSALS as error:
            self.show_refusal(str(error))

    def _draw_picture(self, passed: float) -> None:
        """Draw the next picture; after an error no more, for the same would fail again."""
        with self.server.atomic():  # one message to wake the server for all that is sent
            drawn = self.errors.run("drawing stopped", lambda: self.advance(passed))
        self._stopped_at = None if drawn else time.monotonic()
