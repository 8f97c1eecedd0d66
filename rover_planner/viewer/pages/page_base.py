"""What every page has: a viser server, its panels, and the one thread that changes them."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from rover_planner.viewer.panel.charts import Charts
from rover_planner.viewer.panel.error_notice import ErrorNotice
from rover_planner.viewer.scene.ground_mesh import hit_ground
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.session import REFUSALS, ViewSession
from rover_planner.viewer.state.visitor_requests import VisitorRequests

FRAME = 0.04
"""Time between two pictures [s]."""
PANEL_WIDTH, PLOTS_WIDTH = 380, 300
"""Widths of what is docked right and left [px]; a laptop's screen leaves the middle free."""


class PageBase(ABC):
    """A served page. Callbacks of the browser only leave wishes for the page's own thread.

    No error ends that thread. One in a request is shown, and the next request is taken. One in
    `advance` stops the pictures until the next request, or for `retry_after` [s].
    """

    retry_after = math.inf

    def __init__(self, session: ViewSession, host: str, port: int):
        """Start to serve; `port` 0 takes a free one. `run` starts the thread."""
        import viser

        self.session = session
        self.wishes = VisitorRequests()
        self._ended = threading.Event()
        self._stopped_at: float | None = None
        """When the pictures stopped because of an error [s]; None while they go on."""
        self.server = viser.ViserServer(host, port, label="rover_planner", verbose=False)
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.scene = Scene(self.server)
        self._dock_panels()
        self.server.on_client_connect(self._welcome)
        self.server.scene.on_click()(lambda event: self._ask_click(event, False))
        self.server.scene.on_click(modifier="shift")(lambda event: self._ask_click(event, True))
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def start(self) -> None:
        """Let the page move."""
        self._thread.start()

    def close(self) -> None:
        """End the page."""
        self._ended.set()
        self._thread.join(5.0)
        self.server.stop()

    def wait(self) -> None:
        """Serve until the page is closed or the program is interrupted."""
        while not self._ended.wait(0.5):
            pass

    @abstractmethod
    def fill_panel(self, tabs: Any) -> None:
        """Add tabs to the main panel."""

    @abstractmethod
    def click(self, place: np.ndarray | None, shift: bool) -> None:
        """Do what a click on the ground asks for: its place (2,) [m], None beside the ground."""

    @abstractmethod
    def advance(self, seconds: float) -> None:
        """Move on by the time that passed for the visitor [s]; called for every picture."""

    @abstractmethod
    def tell_refusal(self, reason: str) -> None:
        """Say why something was refused."""

    def _dock_panels(self) -> None:
        gui = self.server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self.errors = ErrorNotice(gui)
        self.fill_panel(gui.add_tab_group())
        plots = gui.add_panel()
        with plots.add_tab("Plots over distance [m]"):
            self.charts = Charts(gui)
        plots.dock_left()
        plots.set_width(PLOTS_WIDTH)

    def _welcome(self, client: Any) -> None:
        session = self.session
        self.scene.look_along(client, session.rover, session.terrain, session.start, session.goal)

    def _ask_click(self, event: Any, shift: bool) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        self.wishes.ask(
            lambda: self.click(hit_ground(self.session.terrain, origin, direction), shift), "click"
        )

    def _run(self) -> None:
        last = due = time.monotonic()
        while not self._ended.is_set():
            self.wishes.wait(due - time.monotonic())
            for act in self.wishes.take():
                self._fulfil(act)
            now = time.monotonic()
            passed, last, due = now - last, now, now + FRAME
            if self._stopped_at is None or now - self._stopped_at > self.retry_after:
                self._draw_picture(passed)

    def _fulfil(self, act: Callable[[], None]) -> None:
        """Do what a visitor asks for; the pictures go on if an error had stopped them."""
        self.errors.run("the last request failed", lambda: self._try(act))
        self._stopped_at = None

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except REFUSALS as error:
            self.tell_refusal(str(error))

    def _draw_picture(self, passed: float) -> None:
        """Move on by a time [s]; stop after an error, for the same would fail again."""
        drawn = self.errors.run("drawing stopped", lambda: self.advance(passed))
        self._stopped_at = None if drawn else time.monotonic()
