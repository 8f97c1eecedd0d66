# SPDX-License-Identifier: Apache-2.0
"""The page that follows a live rover: the data of its topics, and plans asked of its server."""

import time

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.viewer.browser.link import read_link
from rover_planner.viewer.live.listener import NO_ODOMETRY, LiveData, LiveListener
from rover_planner.viewer.live.live_state import StateBuilder, TopicAge
from rover_planner.viewer.pages.base import PageBase
from rover_planner.viewer.panel.board import BoardNotes
from rover_planner.viewer.panel.dashboard import describe_verdict, draw_topics
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.ground_tab import GroundActions, GroundTab
from rover_planner.viewer.panel.header import Chip, verdict_chip
from rover_planner.viewer.panel.history import History
from rover_planner.viewer.panel.plots import Curves
from rover_planner.viewer.scene.ground_mesh import build_ground_mesh, export_ground
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN
from rover_planner.viewer.state.context import Context
from rover_planner.viewer.state.session import ViewSession

DASHBOARD_PERIOD = 0.2
"""Time between two updates of dashboard and plots [s]."""
GROUND_PERIOD = 2.0
"""Shortest time between two pictures of the ground [s]."""
RETRY = 2.0
"""Time from an error in a picture to the next one, which shows newer data [s]."""
ARM_STEP = 0.01
"""Smallest turn of the arm that is drawn [rad]."""


class LivePage(PageBase):
    """Shows the data of a listener; a click on the ground asks the server for a plan."""

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
            listener: Source of the data; the caller spins it.
            host: Address to serve on.
            port: Port to serve on; 0 takes a free one.
            has_ground: Whether the session's terrain is that of the rover.
        """
        self._listener = listener
        self._history = History()
        self._refusal = ""
        self._shown: LiveData | None = None
        """The data whose plan and verdict are shown; None to show them again.

        It is kept, so that no later plan can have the same identity."""
        self._shown_refusal = ""
        self._last_terrain: Terrain | None = None
        self._updated_at = self._ground_at = 0.0
        self._camera_aimed = False
        self._given_ground = session.ground_name if has_ground else "map not known yet"
        """The page's name of the ground until a map comes."""
        self._freshness = _describe_freshness(NO_ODOMETRY)
        super().__init__(session, host, port)
        self._builder = StateBuilder(session.rover)
        self.scene.draw_rover(session.rover, {})
        self._has_ground = has_ground
        self._draw_ground()
        self.start()

    def fill_panel(self) -> None:
        """Add the tabs Drive and Ground."""
        gui, add = self.server.gui, self.requests.add
        tabs = gui.add_tab_group()
        self.drive_tab = DriveTab(gui, tabs.add_tab("Drive"), self.requests, None)
        actions = GroundActions(
            recolour=lambda: add(self._draw_ground, "colours"),
            show_forces=lambda visible: add(lambda: self.scene.show_forces(visible)),
        )
        with tabs.add_tab("Ground"):
            self.ground_tab = GroundTab(gui, actions, has_paths=False)

    def describe_context(self) -> tuple[Context, tuple[Chip, ...]]:
        """Return what is followed, the server's verdict, and whether the data are fresh."""
        rover, terrain = self.session.rover, self.session.terrain
        ground = "elevation_cloud" if self._last_terrain is not None else self._given_ground
        context = Context(rover.name, ground, ", ".join(terrain.soil_names), "", "live")
        verdict = self._shown.verdict if self._shown is not None else None
        passable = None if verdict is None else verdict.traversable
        return context, (verdict_chip(passable, ""), self._freshness)

    def click(self, point: Floats | None, shift: bool) -> None:
        """Ask the server for a plan to a point."""
        if point is None or not self._has_ground:
            self.show_refusal("the click is beside the known ground")
        else:
            self.show_refusal(self._listener.request_plan(point))

    def hear(self, word: str, rest: str) -> None:
        """Refuse a link; the plan is the only path, and the rover is where it is."""
        if word == "open" and read_link(rest) is not None:
            raise PlanningError("this page follows a live rover, so it opens no links")

    def path_to_look_at(self) -> Floats:
        """Return x and y (2, 2) [m] of the places between which the rover was first seen."""
        return np.array([self.session.scenario.start[:2], self.session.scenario.goal[:2]])

    def show_refusal(self, reason: str) -> None:
        """Show, as text, why a request was refused; nothing if the reason is empty."""
        self._refusal = reason

    def _draw_ground(self) -> None:
        if self._has_ground:
            self.errors.run("the ground is not drawn", self._build_ground)

    def _build_ground(self) -> None:
        tab, session = self.ground_tab, self.session
        heading = float(np.radians(tab.heading))
        ground = build_ground_mesh(session.rover, session.terrain, tab.layer, heading)
        self.scene.draw_ground(export_ground(ground.mesh, self.scene.frame.origin))
        tab.show_scale(ground.scale)

    def advance(self, seconds: float) -> None:
        """Show the latest data."""
        data = self._listener.latest()
        self._freshness = _describe_freshness(data.odometry)
        now = time.monotonic()
        self._show_ground(data, now)
        self._show_plan(data)
        state = self._builder.build(data.values)
        self.scene.show(state)
        update = now - self._updated_at > DASHBOARD_PERIOD
        self._updated_at = now if update else self._updated_at
        if state is None:
            if update:
                self.drive_tab.show(self.session.rover, None, "waiting for odometry")
                self.drive_tab.show_below(draw_topics(data.ages))
            return
        self._turn_arm(data)
        if not self._camera_aimed:
            self._camera_aimed = True
            self._aim_cameras(state.position)
        moved = self._history.add(state)
        if update:
            source = data.values.forces_from or "forces not known"
            word = self._freshness.word
            stale = data.odometry.is_stale
            notes = BoardNotes(has_slip=bool(np.nan_to_num(state.slip_ratio).any()))
            status = f"{word}; {source}"
            self.drive_tab.show(self.session.rover, state, status, notes, stale=stale)
            self.drive_tab.show_below(draw_topics(data.ages))
        if moved and update:
            curves = Curves(self._history.distance, self._history.values)
            self.plots.set_curves(self.session.rover, curves)
            self.plots.move_cursor(state.distance)

    def _show_ground(self, data: LiveData, now: float) -> None:
        """Show a new map, at most every GROUND_PERIOD."""
        terrain = data.terrain
        if terrain is None or terrain is self._last_terrain:
            return
        if now - self._ground_at < GROUND_PERIOD:
            return
        self._last_terrain = terrain
        self.session.move(terrain=terrain)
        if self.scene.frame.move_to(terrain):
            self._camera_aimed = False
        self._ground_at, self._has_ground, self._shown = now, True, None
        self._draw_ground()

    def _show_plan(self, data: LiveData) -> None:
        """Show plan, verdict and refusal if one of them has changed."""
        shown = self._shown
        if (
            shown is not None
            and shown.plan is data.plan
            and shown.verdict == data.verdict
            and self._shown_refusal == self._refusal
        ):
            return
        self._shown, self._shown_refusal = data, self._refusal
        verdict, session = data.verdict, self.session
        passable = None if verdict is None else verdict.traversable
        reason = "click the ground to ask for a plan" if verdict is None else verdict.reason
        self.drive_tab.show_verdict(describe_verdict(passable, reason, self._refusal, ""))
        self.errors.run(
            "the plan is not drawn",
            lambda: self.scene.paths.show_plan(session.rover, session.terrain, data.plan),
        )

    def _turn_arm(self, data: LiveData) -> None:
        arm = self.session.rover.manipulator
        if arm is not None:
            joints = data.values.joints
            known = {name: joints[name] for name in arm.joints if name in joints}
            steps = {name: ARM_STEP * round(angle / ARM_STEP) for name, angle in known.items()}
            self.scene.turn_arm(steps)

    def _aim_cameras(self, position: Floats) -> None:
        """Aim the cameras of all visitors, present and future, at the rover."""
        ahead = (float(position[0]) + 4.0, float(position[1]), 0.0)
        self.session.move(start=(float(position[0]), float(position[1]), 0.0), goal=ahead)
        for client in self.server.get_clients().values():
            self._aim_camera(client)


def _describe_freshness(odometry: TopicAge) -> Chip:
    """Return the chip that tells whether the page shows the rover as it is now."""
    if odometry.age is None:
        return Chip("waiting for odometry", UNKNOWN, "fresh")
    if odometry.is_stale:
        return Chip(f"not live: odometry is {odometry.age:.0f} s old", REFUSED, "fresh")
    return Chip("live", PASSABLE, "fresh")
