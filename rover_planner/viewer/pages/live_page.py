"""The page that follows a live rover: what its topics tell, and plans asked of its server."""

import time
from typing import Any

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.live.listener import Heard, LiveListener
from rover_planner.viewer.live.live_frame import LiveFigure
from rover_planner.viewer.pages.page_base import PageBase
from rover_planner.viewer.panel.board import describe_verdict
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.ground_tab import GroundActions, GroundTab
from rover_planner.viewer.panel.history import History
from rover_planner.viewer.scene.ground_mesh import draw_ground
from rover_planner.viewer.state.session import ViewSession

BOARD_FRAME = 0.2
"""Time between two pictures of board and plots [s]."""
GROUND_FRAME = 2.0
"""Shortest time between two pictures of the ground [s]."""
RETRY = 2.0
"""Time from an error to the next picture, of what was heard since [s]."""
ARM_STEP = 0.01
"""Smallest turn of the arm that is shown [rad]."""


class LivePage(PageBase):
    """Shows what a listener hears; a click on the ground asks the server for a plan."""

    retry_after = RETRY

    def __init__(
        self,
        session: ViewSession,
        listener: LiveListener,
        host: str = "127.0.0.1",
        port: int = 8080,
        *,
        has_ground: bool = False,
    ):
        """Start to serve.

        Args:
            session: Holds the rover, and a terrain until a map comes.
            listener: What to show; somebody else spins it.
            host: Address to serve on.
            port: Port to serve on; 0 takes a free one.
            has_ground: Whether the session's terrain is that of the rover.
        """
        self._listener = listener
        self._history = History()
        self._refusal = ""
        self._told: Heard | None = None
        self._told_refusal = ""
        self._heard_ground: Terrain | None = None
        self._board_at = self._ground_at = 0.0
        self._looked = False
        super().__init__(session, host, port)
        self._figure = LiveFigure(session.rover)
        self.scene.draw_rover(session.rover, {})
        self._has_ground = has_ground
        if has_ground:
            self._draw_ground()
        self.start()

    def fill_panel(self, tabs: Any) -> None:
        """Add the tabs Drive and Ground."""
        gui, ask = self.server.gui, self.wishes.ask
        with tabs.add_tab("Drive"):
            self.drive_tab = DriveTab(gui, None, self.wishes)
        actions = GroundActions(
            recolour=lambda: ask(self._draw_ground, "colours"),
            show_forces=lambda visible: ask(lambda: self.scene.show_forces(visible)),
            follow=lambda follows: ask(lambda: setattr(self.scene, "follows", follows)),
        )
        with tabs.add_tab("Ground"):
            self.ground_tab = GroundTab(gui, actions, plans=False)

    def click(self, place: np.ndarray | None, shift: bool) -> None:
        """Ask the server for a plan to a place."""
        if place is None or not self._has_ground:
            self.tell_refusal("the click is beside the known ground")
        else:
            self.tell_refusal(self._listener.ask_for(place))

    def tell_refusal(self, reason: str) -> None:
        """Say why something was refused, or nothing if that is empty."""
        self._refusal = reason

    def _draw_ground(self) -> None:
        if self._has_ground:
            self.errors.run("the ground is not drawn", self._build_ground)

    def _build_ground(self) -> None:
        tab, session = self.ground_tab, self.session
        heading = float(np.radians(tab.heading))
        ground = draw_ground(session.rover, session.terrain, tab.layer, heading)
        self.scene.draw_ground(ground)
        tab.show_scale(ground)

    def advance(self, seconds: float) -> None:
        """Show the latest."""
        heard = self._listener.latest()
        now = time.monotonic()
        self._take_ground(heard, now)
        self._tell(heard)
        frame = self._figure.frame(heard.state)
        self.scene.show(frame)
        board_due = now - self._board_at > BOARD_FRAME
        self._board_at = now if board_due else self._board_at
        if frame is None:
            if board_due:
                self.drive_tab.show(self.session.rover, None, "waiting for odometry")
            return
        self._turn_arm(heard)
        if not self._looked:
            self._looked = True
            self._look_at_rover(frame.position)
        moved = self._history.add(frame)
        if board_due:
            words = heard.state.forces_from or "nothing tells of the forces"
            self.drive_tab.show(self.session.rover, frame, f"live; {words}")
        if moved and board_due:
            self.charts.take(self.session.rover, self._history.distance, self._history.values)
            self.charts.show(frame.distance)

    def _take_ground(self, heard: Heard, now: float) -> None:
        """Take another map, but draw none more often than every GROUND_FRAME."""
        new = heard.terrain is not None and heard.terrain is not self._heard_ground
        if not new or now - self._ground_at < GROUND_FRAME:
            return
        assert heard.terrain is not None
        self._heard_ground = self.session.terrain = heard.terrain
        self._ground_at, self._has_ground, self._told = now, True, None
        self._draw_ground()

    def _tell(self, heard: Heard) -> None:
        """Show plan and verdict where they are others than before."""
        told = self._told
        if (
            told is not None
            and told.plan is heard.plan
            and told.verdict == heard.verdict
            and self._told_refusal == self._refusal
        ):
            return
        # What was shown is kept, so that no other plan can come to lie at the same address.
        self._told, self._told_refusal = heard, self._refusal
        verdict = heard.verdict
        passable = None if verdict is None else verdict.traversable
        reason = "click the ground to ask for a plan" if verdict is None else verdict.reason
        self.drive_tab.show_verdict(describe_verdict(passable, reason, self._refusal, ""))
        session = self.session
        self.errors.run(
            "the plan is not drawn",
            lambda: self.scene.paths.show_plan(session.rover, session.terrain, heard.plan),
        )

    def _turn_arm(self, heard: Heard) -> None:
        arm = self.session.rover.manipulator
        if arm is not None:
            joints = heard.state.joints
            known = {name: joints[name] for name in arm.joints if name in joints}
            steps = {name: ARM_STEP * round(angle / ARM_STEP) for name, angle in known.items()}
            self.scene.turn_arm(steps)

    def _look_at_rover(self, position: np.ndarray) -> None:
        ahead = (float(position[0]) + 4.0, float(position[1]), 0.0)
        self.session.start, self.session.goal = (*position[:2], 0.0), ahead
        for client in self.server.get_clients().values():
            self._welcome(client)
