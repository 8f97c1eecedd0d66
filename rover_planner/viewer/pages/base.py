# SPDX-License-Identifier: Apache-2.0
"""The base of every page: its channel, viser's scene, and the one thread that changes them."""

import socket
import threading
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.viewer.front.channel import Channel, Mailbox, Part
from rover_planner.viewer.scene.ground_mesh import intersect_ground
from rover_planner.viewer.scene.scene import START, VIEWS, Scene
from rover_planner.viewer.state.background_work import BackgroundWork, Inbox, Result, Steps, Take
from rover_planner.viewer.state.layers import PREDICTED, Colouring, ShownSurvey, list_layers
from rover_planner.viewer.state.session import REFUSALS

PERIOD = 0.04
"""Time between two pictures [s]."""
DRAWING_TIME = 0.2
"""Longest time for which work in the background waits for the drawings [s]."""
FOLLOW, STAY = "Follow", "Stay"
"""The last button of the camera: go along with the rover, or stop that."""
Action = Callable[[], object]
Words = dict[str, Any]
"""What a visitor asks: the word `ask` and its values."""
Answer = Callable[[Words], Mapping[str, Part] | None]
"""Acts on what a visitor asks; returns parts for this visitor alone, if there are any."""
HOTKEYS: dict[Any, tuple[str, Words]] = {
    "space": ("Play or pause", {"ask": "toggle"}),
    "arrowleft": ("Step back", {"ask": "step", "by": -1}),
    "arrowright": ("Step", {"ask": "step", "by": 1}),
    "home": ("To the start", {"ask": "seek", "time": 0.0}),
}
"""What keys ask, by the name of the key in small letters."""
CONTINUOUS = ("value", "seek", "place")
"""Words that come dozens of times a second while a slider is dragged."""
TELLING = "what is shown is old"
"""What is told where what is shown cannot be told."""
MAX_PORT = 65535
HERE = ("127.0.0.1", 0)
"""A free port of this machine alone."""


class PageBase(ABC):
    """A served page. Callbacks of browsers only add requests for the page's own thread.

    No error ends that thread: the page shows it, and goes on.
    """

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        address: tuple[str, int],
        ground_name: str,
        survey: ShownSurvey | None = None,
    ):
        """Start the servers; the page of a kind starts the thread when it can tell what it shows.

        Args:
            rover: The rover.
            terrain: The ground.
            address: Where to serve: a host, and the port of the page; the scene has the next free
                one. 0 takes free ones.
            ground_name: What the page calls the ground; empty if it is not that of the rover.
            survey: A survey of rover and ground, whose layers are offered.
        """
        import viser

        self._host, port = address
        self.ground, self.ground_name, self.survey = terrain, ground_name, survey
        """Ground, its name and survey that are shown."""
        self.requests: Inbox[Action] = Inbox()
        self.colouring, self.forces = Colouring(self.layers[0]), True
        self._ended = threading.Event()
        own: dict[str, Answer] = {"colour": self._colour, "forces": self._show_forces}
        self._answers = {**own, **self.list_answers()}
        try:
            self.channel = Channel(self._host, port, self.hear)
        except OSError:  # the port is taken
            self.channel = Channel(self._host, 0, self.hear)
        scene_port = self.channel.port + 1 if port and self.channel.port < MAX_PORT else 0
        self.server = viser.ViserServer(self._host, scene_port, label="camera", verbose=False)
        self.errors: dict[str, str] = {}
        """Why parts of its work have failed; each stays until the same part succeeds."""
        self.works: list[BackgroundWork] = []
        """Works in the background."""
        self._made_of: dict[str, tuple[Any, ...]] = {}
        self.scene = Scene(self.server)
        self.scene.canvas.move_to(terrain)
        self.scene.rover.take(rover, {})
        self._add_camera()
        self.painter = self.begin_work(self._draw_ground, "ground")
        keys = {key: words for key, (_, words) in HOTKEYS.items()}
        self.channel.tell("scene", {"port": self.server.get_port(), "keys": keys})
        self.thread = threading.Thread(target=self._run, name="page", daemon=True)
        """Changes the page."""

    def _add_camera(self) -> None:
        """Add what needs to know which visitor looks: the camera and clicks into the scene."""
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.set_panel_label("Camera")
        self._camera = gui.add_button_group("View", (*VIEWS, FOLLOW))
        self._camera.on_click(
            lambda event: self.requests.put(partial(self._look, event.client, event.target.value))
        )
        for key, (label, words) in HOTKEYS.items():
            gui.add_command(label, hotkey=key).on_trigger(partial(self._press, words))
        self.server.on_client_connect(lambda client: self._look(client, START))
        self.server.scene.on_click()(partial(self._request_click, shift=False))
        self.server.scene.on_click(modifier="shift")(partial(self._request_click, shift=True))

    @property
    def url(self) -> str:
        """Address of the page."""
        host = "localhost" if self._host in ("0.0.0.0", "::") else self._host
        return f"http://{host}:{self.channel.port}"

    def close(self) -> None:
        """End the page."""
        self._ended.set()
        self.thread.join(5.0)
        for work in self.works:
            work.close()
        self.channel.close()
        self.server.stop()

    def wait(self) -> None:
        """Serve until the page is closed or the program is interrupted."""
        self._ended.wait()

    def hear(self, words: Words, mailbox: Mailbox | None = None) -> None:
        """Take what a visitor asks; a later value of a slider replaces an earlier one."""
        answer = self._answers.get(str(words.get("ask")))
        if answer is not None:
            word = words["ask"]
            kind = f"{word} {words.get('label', '')}" if word in CONTINUOUS else ""
            self.requests.put(partial(self._answer, answer, words, mailbox or Inbox()), kind)

    def _answer(self, answer: Answer, words: Words, mailbox: Mailbox) -> None:
        for name, part in (answer(words) or {}).items():
            mailbox.put(part, name)

    def begin_work(self, take: Take[Result], name: str) -> BackgroundWork[Result]:
        """Return work in threads of a name; what it finds is taken by the page's thread.

        The work waits until that is drawn: what it finds next would slow down the drawings.
        """

        def hand_over(steps: Steps[Result], found: Result | BaseException) -> None:
            drawn = threading.Event()
            self.requests.put(partial(take, steps, found))
            self.requests.put(drawn.set)
            drawn.wait(DRAWING_TIME)

        begun = BackgroundWork(hand_over, name)
        self.works.append(begun)
        return begun

    @abstractmethod
    def list_answers(self) -> Mapping[str, Answer]:
        """Return what the page does by the word `ask`; refusals are raised as errors."""

    @abstractmethod
    def paint(self) -> None:
        """Begin to colour the ground, if it is known."""

    @abstractmethod
    def click(self, point: Floats, shift: bool) -> None:
        """Act on a click at a point of the ground (2,) [m]."""

    @abstractmethod
    def advance(self, seconds: float) -> None:
        """Draw the next picture, after a time of the visitor [s]."""

    @abstractmethod
    def tell(self) -> None:
        """Tell what is shown; called in each period, with or without pictures."""

    @abstractmethod
    def show_refusal(self, reason: str) -> None:
        """Show why a request was refused."""

    @property
    def layers(self) -> Sequence[str]:
        """The layers that may colour the ground, those of a survey first."""
        surveyed = () if self.survey is None else self.survey.names
        return [*surveyed, *list_layers(self.ground)]

    def list_chosen(self) -> dict[str, Any]:
        """Return the part `chosen` as far as each page has it: what is chosen, and from what."""
        offers = {"layers": self.layers, "predicted": list(PREDICTED)}
        return {**asdict(self.colouring), "forces": self.forces, **offers}

    def _draw_ground(self, _steps: Any, painted: Any) -> None:
        def draw() -> None:
            if isinstance(painted, BaseException):
                raise painted
            file, legend = painted
            add = self.server.scene.add_glb
            add("/ground", file, cast_shadow=False, receive_shadow=False)
            self.channel.tell("legend", legend)

        self.run("the ground is not drawn", draw)

    def _colour(self, words: Words) -> None:
        if words["layer"] not in self.layers:
            raise PlanningError(f"there is no layer {words['layer']!r}")
        self.colouring = Colouring(words["layer"], float(words["heading"]), bool(words["along"]))
        self.paint()

    def _show_forces(self, words: Words) -> None:
        self.forces = bool(words["shown"])
        for one in (self.scene.rover, self.scene.ghost):
            self.scene.canvas.show_frame(one.forces, visible=self.forces)

    def _press(self, words: Words, _event: Any) -> None:
        self.hear(words)

    def _look(self, client: Any, name: str) -> None:
        """Show a view, or go along with the rover or not, and name the button by what is next."""
        if name in (FOLLOW, STAY):
            self.scene.follow(name == FOLLOW)
            self._camera.options = (*VIEWS, STAY if name == FOLLOW else FOLLOW)
        else:
            self.scene.look(name, [client])

    def _request_click(self, event: Any, shift: bool) -> None:
        def click() -> None:
            origin = self.scene.canvas.origin + event.ray_origin
            direction = np.array(event.ray_direction)
            index = self.scene.paths.find_number(origin, direction)
            if index is not None:
                self.hear({"ask": "show", "index": index})
                return
            point = intersect_ground(self.ground, origin, direction)
            if point is None:
                raise PlanningError("the click is beside the known ground")
            self.click(point, shift)

        self.requests.put(click, "click")

    def _run(self) -> None:
        """Fulfil the requests, tell what they have changed, and draw the next picture if due."""
        self.run(TELLING, self.tell)
        self.channel.open()
        last = time.monotonic()
        while not self._ended.is_set():
            self.requests.wait(last + PERIOD - time.monotonic())
            for action in self.requests.take().values():
                self.run("the last request failed", action, self.show_refusal)
            self.run(TELLING, self.tell)
            now = time.monotonic()
            passed, last = now - last, now
            with self.server.atomic():  # one message to wake the server for all that is sent
                self.run("drawing stopped", partial(self.advance, passed))

    def run(
        self, failure: str, work: Action, refuse: Callable[[str], object] | None = None
    ) -> None:
        """Do a part of the page's work; an error in it is told, and stops no other.

        Args:
            failure: What is told of an error, such as "the paths are not drawn".
            work: The part.
            refuse: Takes the reason of a refusal, which then is no error.
        """
        message = ""
        try:
            work()
        except REFUSALS as error:
            message = "" if refuse else str(error)
            if refuse:
                refuse(str(error))
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            if self.errors.get(failure) != message:
                traceback.print_exc()
        if self.errors.get(failure, "") != message:
            self.errors.pop(failure, None)
            self.errors |= {failure: message} if message else {}
            self.channel.tell("errors", [[what, why] for what, why in self.errors.items()])

    def has_changed(self, name: str, *made_of: Any) -> bool:
        """Return whether something is made of other objects than when this was asked last."""
        before, self._made_of[name] = self._made_of.get(name, ()), made_of
        return [*map(id, before)] != [*map(id, made_of)]

    def tell_made(self, name: str, make: Callable[..., Part], *made_of: Any) -> None:
        """Tell a part that is made of objects, anew only if one of them is another object."""
        if self.has_changed(name, *made_of):
            self.channel.tell(name, make(*made_of))

    def draw_made(self, failure: str, draw: Callable[..., object], *made_of: Any) -> None:
        """Draw what is made of objects, anew only if one of them is another object.

        Args:
            failure: What is told of an error, such as "the paths are not drawn".
            draw: Draws it.
            made_of: The objects.
        """
        if self.has_changed(failure, *made_of):
            with self.server.atomic():
                self.run(failure, partial(draw, *made_of))


def check_host(host: str) -> None:
    """Check that this machine can serve on a host, a name or an address.

    Raises:
        PlanningError: It is no address of this machine.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.create_server((host, 0), family=family).close()
    except (OSError, UnicodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise PlanningError(
            f"host is {host!r}; it must be an address of this machine, such as 127.0.0.1 or "
            f"0.0.0.0 ({reason})"
        ) from error
