# SPDX-License-Identifier: Apache-2.0
"""The base of every page: a viser server, its panels, and the one thread that changes them."""

import math
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

import numpy as np

from rover_physics.files.validation import describe
from rover_physics.numerics.arrays import Floats
from rover_planner.errors import PlanningError
from rover_planner.viewer.browser.words import add_script
from rover_planner.viewer.panel.header import Chip, Header
from rover_planner.viewer.panel.notices import ErrorNotice
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
PANEL_WIDTH, PLOTS_WIDTH = 394, 300
"""Widths of the panels on the right and on the left [px]; a laptop's screen shows the scene."""
FOLLOW, STAY = "Follow", "Stay"
"""The last button of the camera: go along with the rover, or stop that."""
MAX_PORT = 65535


class Drawings:
    """Drawings that follow the verdict, one at a time, in the order in which they were asked for.

    A drawing shows what there is when it is done. One that is asked for again while it waits is
    done once, at its old place in the order: it is never put off by newer changes. All methods
    belong to the page's own thread, except for `waiting`.
    """

    def __init__(self, errors: ErrorNotice, together: Callable[[], AbstractContextManager[None]]):
        """Begin with nothing to draw.

        Args:
            errors: Shows what could not be drawn.
            together: Returns a context whose messages reach the visitors together.
        """
        self._errors, self._together = errors, together
        self._asked: dict[str, Action] = {}

    @property
    def waiting(self) -> bool:
        """True if something is still to be drawn, or is being drawn."""
        return bool(self._asked)

    def ask(self, failure: str, draw: Action) -> None:
        """Draw something soon.

        Args:
            failure: What the page says if it fails, such as "the paths are not drawn"; it also
                tells drawings apart.
            draw: Draws it.
        """
        self._asked[failure] = draw

    def draw_next(self) -> None:
        """Draw what has waited longest, if there is anything."""
        if not self._asked:
            return
        failure, draw = next(iter(self._asked.items()))
        with self._together():
            self._errors.run(failure, draw)
        if self._asked[failure] is draw:
            del self._asked[failure]

    def draw_all(self) -> None:
        """Draw all that waits."""
        while self._asked:
            self.draw_next()


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
        self.server.on_client_connect(self._aim_camera)
        self.server.scene.on_click()(partial(self._request_click, shift=False))
        self.server.scene.on_click(modifier="shift")(partial(self._request_click, shift=True))
        self._last = self._due = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    @property
    def is_drawing(self) -> bool:
        """True if the page acts on requests, or has still to draw what they have changed."""
        return self._fulfils or self.drawings.waiting

    def start(self) -> None:
        """Start the thread that changes the page."""
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
    def fill_panel(self) -> None:
        """Add notices and tabs to the main panel."""

    @abstractmethod
    def click(self, point: Floats | None, shift: bool) -> None:
        """Act on a click at a point of the ground (2,) [m]; None beside known ground."""

    @abstractmethod
    def hear(self, word: str, rest: str) -> None:
        """Act on words of the page's script.

        Args:
            word: "open" a link, "show" a path, or "seek" on lanes and plots.
            rest: The query of the address, the number of the path from 1, or the share, 0 to 1, of
                the distance.

        Raises:
            RoverError, PlanningError: This page cannot.
        """

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

    @abstractmethod
    def path_to_look_at(self) -> Floats:
        """Return x and y (n, 2) [m] of what a view of everything shows."""

    def _add_panels(self) -> None:
        gui = self.server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self.header = Header(gui)
        self.errors = ErrorNotice(gui)
        self.drawings = Drawings(self.errors, self.server.atomic)
        add = self.requests.add
        add_script(gui, lambda word, rest: add(lambda: self.hear(word, rest), word))
        self._camera = gui.add_button_group("Camera", (*VIEWS, FOLLOW))
        self._camera.on_click(self._request_view)
        left = gui.add_panel()
        with left.add_tab("Limits and plots"):
            self.plots = Plots(gui)
        left.dock_left()
        left.set_width(PLOTS_WIDTH)
        self.fill_panel()

    def _aim_camera(self, client: Any) -> None:
        now = self.session.scenario
        self.scene.aim_camera(client, now.rover, now.terrain, now.start, now.goal)

    def _request_view(self, event: Any) -> None:
        client, name = event.client, event.target.value
        act = self._follow if name in (FOLLOW, STAY) else self._look
        self.requests.add(lambda: act(client, name))

    def _look(self, client: Any, view: str) -> None:
        self.scene.look(client, view, self.session.terrain, self.path_to_look_at())

    def _follow(self, _client: Any, name: str) -> None:
        """Go along with the rover or not, and name the button by what it does next."""
        self.scene.follow(name == FOLLOW)
        self._camera.options = (*VIEWS, STAY if name == FOLLOW else FOLLOW)

    def _request_click(self, event: Any, shift: bool) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)

        def click() -> None:
            index = self.scene.paths.find_number(origin, direction)
            if index is not None:
                self.hear("show", f"{index + 1}")
                return
            start = self.scene.frame.to_map(origin)
            self.click(intersect_ground(self.session.terrain, start, direction), shift)

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
        self.errors.run(
            "the header is not shown", lambda: self.header.show(*self.describe_context())
        )
        self.drawings.draw_next()
        now = time.monotonic()
        if self.drawings.waiting and now < self._due:
            return
        passed, self._last, self._due = now - self._last, now, now + PERIOD
        if self._stopped_at is None or now - self._stopped_at > self.retry_after:
            self._draw_picture(passed)

    def _fulfil(self, request: Action) -> None:
        """Act on a request, or say why not; the pictures go on if an error had stopped them."""

        def act() -> None:
            try:
                request()
            except REFUSALS as error:
                self.show_refusal(str(error))

        self.errors.run("the last request failed", act)
        self._stopped_at = None

    def _draw_picture(self, passed: float) -> None:
        """Draw the next picture; after an error no more, for the same would fail again."""
        with self.server.atomic():  # one message to wake the server for all that is sent
            drawn = self.errors.run("drawing stopped", lambda: self.advance(passed))
        self._stopped_at = None if drawn else time.monotonic()


def check_address(host: str, port: int) -> None:
    """Check that this machine can serve on an address; the port itself may be taken.

    viser would search in vain for a free port, or wait for ever.

    Args:
        host: Name or address.
        port: Port; 0 for any free one.

    Raises:
        PlanningError: The port is out of range, or the host is no address of this machine.
    """
    if not 0 <= port <= MAX_PORT:
        raise PlanningError(f"port is {describe(port)}; it must be 0 to {MAX_PORT}")
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, kind, protocol, _, address = found[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.bind(address)
    except (OSError, UnicodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise PlanningError(
            f"host is {host!r}; it must be an address of this machine, such as 127.0.0.1 or "
            f"0.0.0.0 ({reason})"
        ) from error
