"""The base of every page: a viser server, its panels, and the one thread that changes them."""

import math
import threading
import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from rover_planner.viewer.panel.error_notice import ErrorNotice
from rover_planner.viewer.panel.plots import Plots
from rover_planner.viewer.scene.ground_mesh import intersect_ground
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.session import REFUSALS, ViewSession
from rover_planner.viewer.state.visitor_requests import Action, VisitorRequests

PERIOD = 0.04
"""Time between two pictures [s]."""
RESTART = 1.0
"""Time until a stopped page starts again [s]."""
PANEL_WIDTH, PLOTS_WIDTH = 380, 300
"""Widths of the panels on the right and on the left [px]; a laptop's screen shows the scene."""


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
        self._stopped_at: float | None = None
        """When an error stopped the pictures [s]; None while they go on."""
        self.server = viser.ViserServer(host, port, label="rover_planner", verbose=False)
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.scene = Scene(self.server)
        self._add_panels()
        self.server.on_client_connect(self._aim_camera)
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
    def show_refusal(self, reason: str) -> None:
        """Show, as text, why a request was refused."""

    def _add_panels(self) -> None:
        gui = self.server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self.errors = ErrorNotice(gui)
        self.add_notices()
        self.fill_panel(gui.add_tab_group())
        left = gui.add_panel()
        with left.add_tab("Plots over distance [m]"):
            self.plots = Plots(gui)
        left.dock_left()
        left.set_width(PLOTS_WIDTH)

    def _aim_camera(self, client: Any) -> None:
        session = self.session
        self.scene.aim_camera(client, session.rover, session.terrain, session.start, session.goal)

    def _request_click(self, event: Any, shift: bool) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)

        def click() -> None:
            self.click(intersect_ground(self.session.terrain, origin, direction), shift)

        self.requests.add(click, "click")

    def _run(self) -> None:
        while not self._ended.is_set():
            if not self.errors.run("stopped", self._run_period):
                self._ended.wait(RESTART)

    def _run_period(self) -> None:
        """Fulfil the requests until the next picture is due, and draw it."""
        self.requests.wait(self._due - time.monotonic())
        self.add_due_requests()
        for action in self.requests.take_all():
            self._fulfil(action)
        now = time.monotonic()
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
        drawn = self.errors.run("drawing stopped", lambda: self.advance(passed))
        self._stopped_at = None if drawn else time.monotonic()
