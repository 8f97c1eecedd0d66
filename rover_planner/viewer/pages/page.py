"""The page that plans: its tabs, and what visitors can request of the session behind it."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.studies.rover_values import RoverValue
from rover_planner.viewer.pages.page_base import PageBase
from rover_planner.viewer.pages.path_display import PathDisplay
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.ground_tab import GroundActions, GroundTab
from rover_planner.viewer.panel.rover_tab import RoverActions, RoverTab
from rover_planner.viewer.scene.ground_mesh import build_ground_mesh
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.session import REFUSALS, ViewSession

REPLAN_DELAY = 0.5
"""Time from the last change of the rover until all candidates are judged again [s]."""
NO_ROVER = "the rover is not drawn"


class Page(PageBase):
    """Plans with the session, and plays the path that is shown."""

    def __init__(self, session: ViewSession, host: str = "127.0.0.1", port: int = 8080):
        """Start to serve a session; port 0 takes a free one."""
        self.playback = Playback()
        self._changed_at: float | None = None
        """When the rover was changed last [s]; None if all candidates are judged for it."""
        super().__init__(session, host, port)
        self._display = PathDisplay(session, self.playback, self.scene, self.drive_tab, self.plots)
        self._show_rover()
        self.start()

    def fill_panel(self, tabs: Any) -> None:
        """Add the tabs Drive, Rover, and Ground and path."""
        gui = self.server.gui
        with tabs.add_tab("Drive"):
            self.drive_tab = DriveTab(gui, self.playback, self.requests)
        self.rover_tab = RoverTab(gui, tabs.add_tab("Rover"), self._rover_actions())
        with tabs.add_tab("Ground and path"):
            self.ground_tab = GroundTab(gui, self._ground_actions())

    def _rover_actions(self) -> RoverActions:
        add = self.requests.add
        return RoverActions(
            load=lambda read: add(lambda: self._load(read)),
            change=lambda value, number: add(
                lambda: self._change_value(value, number), f"value {value.keys}"
            ),
            turn_arm=lambda joint, angle: add(
                lambda: self._turn_arm(joint, angle), f"joint {joint}"
            ),
            current=lambda: self.session.rover,
        )

    def _ground_actions(self) -> GroundActions:
        add = self.requests.add
        return GroundActions(
            choose_path=lambda index: add(lambda: self._choose_path(index), "path"),
            set_options=lambda **changes: add(lambda: self._change_options(**changes)),
            recolour=lambda: add(self._draw_ground, "colours"),
            show_forces=lambda visible: add(lambda: self.scene.show_forces(visible)),
            follow=lambda follows: add(lambda: setattr(self.scene, "follows", follows)),
        )

    # Requests of visitors.

    def click(self, point: np.ndarray | None, shift: bool) -> None:
        """Set goal or start, and plan."""
        if point is None:
            self.show_refusal("the click is beside the known ground")
        else:
            self.plan(point, "start" if shift else self.ground_tab.click_sets)

    def plan(self, point: np.ndarray, sets: str = "goal") -> None:
        """Plan with a point (2,) [m] as the "goal" or the "start", and show the answer."""
        taken = self.session.plan_to(point) if sets == "goal" else self.session.plan_from(point)
        if taken:
            self.playback.pause()
            self.playback.seek(0.0)
        self._show_answer()

    def show_refusal(self, reason: str) -> None:
        """Show, as text, why a request was refused."""
        self.session.refusal = reason
        self._show_verdict()

    def _change_value(self, value: RoverValue, number: float) -> None:
        if self.session.change_rover(value.keys, number):
            self._draw_rover()
        self._changed_at = time.monotonic()
        self._show_path()

    def _turn_arm(self, joint: str, angle: float) -> None:
        if self.session.change_arm(joint, angle):
            self.errors.run(NO_ROVER, lambda: self.scene.turn_arm(self.session.arm_angles))
        self._changed_at = time.monotonic()
        self._show_path()

    def _choose_path(self, index: int | None) -> None:
        self.session.show_candidate(self.session.answer.nearest if index is None else index)
        self._show_path()

    def _change_options(self, **changes: object) -> None:
        self.session.change_options(**changes)
        self._show_answer()
        self._draw_predicted_ground()

    def _load(self, read: Callable[[], Rover]) -> None:
        try:
            taken = self.session.take_rover(read())
        except REFUSALS as error:
            self.session.refusal, taken = str(error), False
        if taken:
            self._show_rover()
        else:
            self._show_verdict()

    def _plan_again(self) -> None:
        """After a change of the rover: judge all candidates, and colour the ground again."""
        if self.session.refusal:
            self.rover_tab.show_values(self.session.rover)
        elif self.session.plan_again():
            self._show_answer()
            self._draw_predicted_ground()

    # From the session onto the page.

    def _show_rover(self) -> None:
        """Show another rover, and everything that depends on it."""
        self._draw_ground()
        self._draw_rover()
        self.rover_tab.set_rover(self.session.rover)
        self._show_answer()

    def _draw_rover(self) -> None:
        session = self.session
        self.errors.run(NO_ROVER, lambda: self.scene.draw_rover(session.rover, session.arm_angles))

    def _draw_ground(self) -> None:
        self.errors.run("the ground is not drawn", self._build_ground)

    def _build_ground(self) -> None:
        session, tab = self.session, self.ground_tab
        heading = float(np.radians(tab.heading))
        ground = build_ground_mesh(
            session.rover, session.terrain, tab.layer, heading, session.sweep_options()
        )
        self.scene.draw_ground(ground.mesh)
        tab.show_scale(ground.scale)

    def _draw_predicted_ground(self) -> None:
        """Colour the ground again if its layer is predicted for the rover."""
        if self.ground_tab.is_predicted:
            self._draw_ground()

    def _show_answer(self) -> None:
        """Show another answer: the list of its paths and the path that is shown."""
        self.ground_tab.list_paths(self.session.answer.candidates)
        self._show_path()

    def _show_path(self) -> None:
        """Show the shown path as it was judged last: first the verdict, then the drawings."""
        self._show_verdict()
        self._display.play_shown_path()
        self.errors.run("the plots are not drawn", self._display.draw_plots)
        self.errors.run("the paths are not drawn", self._display.draw_paths)

    def _show_verdict(self) -> None:
        """Show the verdict, or why a change was refused, as text."""
        self.rover_tab.show_verdict(self._display.show_verdict())

    def add_due_requests(self) -> None:
        """Request that all candidates are judged, REPLAN_DELAY after a change of the rover."""
        changed = self._changed_at
        if changed is not None and time.monotonic() - changed > REPLAN_DELAY:
            self._changed_at = None
            self.requests.add(self._plan_again, "plan again")

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s]."""
        self._display.advance(seconds)
