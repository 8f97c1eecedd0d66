# SPDX-License-Identifier: Apache-2.0
"""The page that follows a live rover: the data of its topics, and plans asked of its server."""

import time
from collections.abc import Mapping

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.planning.search.query import Site
from rover_planner.viewer.documents.paths import describe_board
from rover_planner.viewer.live.listener import LiveListener
from rover_planner.viewer.live.live_state import (
    LiveData,
    choose_answer,
    describe_learned,
    read_state,
)
from rover_planner.viewer.pages.base import HERE, Answer, PageBase
from rover_planner.viewer.pages.sharing import read_link
from rover_planner.viewer.scene.ground_mesh import paint
from rover_planner.viewer.scene.scene import START

BOARD_PERIOD = 0.2
"""Time between two updates of the board [s]."""
GROUND_PERIOD = 2.0
"""Shortest time between two pictures of the ground [s]."""
ARM_STEP = 0.01
"""Smallest turn of the arm that is drawn [rad]."""
AHEAD = np.array([[0.0, 0.0], [4.0, 0.0]])
"""The rover, and from there to where a new camera looks [m]."""


class LivePage(PageBase):
    """Shows the data of a listener; a click on the ground asks the server for a plan."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        listener: LiveListener,
        address: tuple[str, int] = HERE,
        ground_name: str = "",
    ):
        """Start to serve the data of a listener, which the caller spins, as `PageBase` does.

        The terrain is shown until a map comes.
        """
        self._listener, self._rover, self._refusal = listener, rover, ""
        self._data: LiveData = listener.latest()
        self._is_seen = False
        """True if cameras look at where the rover was first seen."""
        self._told_at = self._ground_at = 0.0
        super().__init__(rover, terrain, address, ground_name)
        self.scene.path_places = AHEAD
        self.paint()
        self.thread.start()

    def list_answers(self) -> Mapping[str, Answer]:
        """Return what the page does by the word `ask`."""
        return {
            "newest": lambda _words: self._listener.forget_click(),
            "open": lambda words: _refuse_link(words["query"]),
        }

    def paint(self) -> None:
        """Begin to colour the ground, if it is known."""
        if self.ground_name:
            self.painter.ask(paint(Site(self._rover, self.ground), self.colouring))

    def click(self, point: Floats, shift: bool) -> None:
        """Ask the server for a plan to a point."""
        if not self.ground_name:
            raise PlanningError("the ground is not known yet")
        self._refusal = ""
        self._listener.request_plan(point)

    def show_refusal(self, reason: str) -> None:
        """Show why a request was refused."""
        self._refusal = reason

    def tell(self) -> None:
        """Tell whose answer is shown and how old it is; the plan has the same age."""
        data, now, tell = self._data, time.monotonic(), self.channel.tell
        answer, plan = choose_answer(data, now, self._refusal)
        tell("verdict", answer)
        soil = ", ".join(self.ground.soil_names)
        ground = self.ground_name or "not known yet"
        facts = {"rover": self._rover.name, "map": ground, "soil": soil, "mode": data.freshness}
        tell("subject", facts)
        tell("chosen", self.list_chosen())
        tell("learned", describe_learned(data.learned))
        draw, old, paths = self.draw_made, bool(answer["old"]), self.scene.paths
        trail = data.trail
        draw("the trail is not drawn", lambda *_: paths.show_trail(trail), trail, self.ground)
        draw(
            "the plan is not drawn", lambda *_: paths.show_plan(plan, old), plan, old, self.ground
        )

    def advance(self, seconds: float) -> None:
        """Show the latest data."""
        data = self._data = self._listener.latest()
        now = time.monotonic()
        self._take_terrain(data, now)
        state = read_state(self._rover, data)
        self.scene.show(state)
        if state is not None:
            arm, joints = self._rover.manipulator, data.joints
            known = [name for name in arm.joints if name in joints] if arm is not None else []
            steps = {name: ARM_STEP * round(joints[name] / ARM_STEP) for name in known}
            self.scene.rover.take(self._rover, steps)
            if not self._is_seen:
                self._is_seen, self.scene.path_places = True, state.position[:2] + AHEAD
                self.scene.look(START)
        if now - self._told_at > BOARD_PERIOD:
            self._told_at, tell = now, self.channel.tell
            tell("board", describe_board(state))
            words = f"{data.freshness}; {data.forces_from or 'forces not known'}"
            tell("drive", {"duration": None, "words": words})
            tell("topics", [
                {"topic": topic, "age": one.describe(), "stale": one.is_stale}
                for topic, one in data.ages.items()
            ])  # fmt: skip

    def _take_terrain(self, data: LiveData, now: float) -> None:
        """Show a new map, at most every GROUND_PERIOD."""
        terrain = data.terrain
        is_soon = now - self._ground_at < GROUND_PERIOD
        if terrain is None or terrain is self.ground or is_soon:
            return
        self.ground, self.ground_name, self._ground_at = terrain, "elevation_cloud", now
        if self.scene.canvas.move_to(terrain):
            self._is_seen = False
        self.paint()


def _refuse_link(query: str) -> None:
    """Refuse a link; the plan is the only path, and the rover is where it is."""
    if read_link(query) is not None:
        raise PlanningError("this page follows a live rover, so it opens no links")
