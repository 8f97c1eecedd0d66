"""The page that plans: its tabs, and what visitors can ask of the session behind it."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.studies.rover_values import RoverValue
from rover_planner.viewer.pages.page_base import PageBase
from rover_planner.viewer.pages.planned_drive import PlannedDrive
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.ground_tab import GroundActions, GroundTab
from rover_planner.viewer.panel.rover_tab import RoverActions, RoverTab
from rover_planner.viewer.scene.ground_mesh import draw_ground
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.session import REFUSALS, ViewSession

REST = 0.5
"""Time after the last change of the rover when all candidates are judged anew [s]."""
NO_ROVER = "the rover is not drawn"


class Page(PageBase):
    """Plans with the session, and plays the path that is shown."""

    def __init__(self, session: ViewSession, host: str = "127.0.0.1", port: int = 8080):
        """Start to serve a session; `port` 0 takes a free one."""
        self.playback = Playback()
        self._changed_at: float | None = None
        super().__init__(session, host, port)
        self._drive = PlannedDrive(session, self.playback, self.scene, self.drive_tab, self.charts)
        self._take_rover()
        self.start()

    def fill_panel(self, tabs: Any) -> None:
        """Add the tabs Drive, Rover, and Ground and path."""
        gui = self.server.gui
        with tabs.add_tab("Drive"):
            self.drive_tab = DriveTab(gui, self.playback, self.wishes)
        self.rover_tab = RoverTab(gui, tabs.add_tab("Rover"), self._rover_actions())
        with tabs.add_tab("Ground and path"):
            self.ground_tab = GroundTab(gui, self._ground_actions())

    def _rover_actions(self) -> RoverActions:
        ask = self.wishes.ask
        return RoverActions(
            load=lambda read: ask(lambda: self._load(read)),
            change=lambda value, number: ask(
                lambda: self._change_value(value, number), f"value {value.keys}"
            ),
            turn_arm=lambda joint, angle: ask(
                lambda: self._turn_arm(joint, angle), f"joint {joint}"
            ),
            current=lambda: self.session.rover,
        )

    def _ground_actions(self) -> GroundActions:
        ask = self.wishes.ask
        return GroundActions(
            choose_path=lambda index: ask(lambda: self._choose_path(index), "path"),
            set_options=lambda **changes: ask(lambda: self._set_options(**changes)),
            recolour=lambda: ask(self._draw_ground, "colours"),
            show_forces=lambda visible: ask(lambda: self.scene.show_forces(visible)),
            follow=lambda follows: ask(lambda: setattr(self.scene, "follows", follows)),
        )

    # What visitors ask for.

    def click(self, place: np.ndarray | None, shift: bool) -> None:
        """Set goal or start, and plan."""
        if place is None:
            self.tell_refusal("the click is beside the known ground")
        else:
            self.plan(place, "start" if shift else self.ground_tab.click_sets)

    def plan(self, place: np.ndarray, sets: str = "goal") -> None:
        """Plan to, or from, a place (2,) [m] and show the answer."""
        taken = self.session.plan_to(place) if sets == "goal" else self.session.plan_from(place)
        if taken:
            self.playback.pause()
            self.playback.jump(0.0)
        self._take_answer()

    def tell_refusal(self, reason: str) -> None:
        """Say why something was refused."""
        self.session.refusal = reason
        self._show_verdict()

    def _change_value(self, value: RoverValue, number: float) -> None:
        if self.session.change_rover(value.keys, number):
            self._draw_rover()
        self._changed_at = time.monotonic()
        self._take_judgement()

    def _turn_arm(self, joint: str, angle: float) -> None:
        if self.session.change_arm(joint, angle):
            self.errors.run(NO_ROVER, lambda: self.scene.turn_arm(self.session.arm_angles))
        self._changed_at = time.monotonic()
        self._take_judgement()

    def _choose_path(self, index: int | None) -> None:
        answer = self.session.answer
        self.session.show_candidate(answer.nearest if index is None else index)
        self._take_judgement()

    def _set_options(self, **changes: object) -> None:
        self.session.take_options(**changes)
        self._take_answer()
        self._draw_prediction()

    def _load(self, read: Callable[[], Rover]) -> None:
        try:
            taken = self.session.take_rover(read())
        except REFUSALS as error:
            self.session.refusal, taken = str(error), False
        if taken:
            self._take_rover()
        else:
            self._show_verdict()

    # What the session holds, onto the page.

    def _take_rover(self) -> None:
        """Show another rover, and what it makes of ground and path."""
        self._draw_ground()
        self._draw_rover()
        self.rover_tab.take(self.session.rover)
        self._take_answer()

    def _draw_rover(self) -> None:
        session = self.session
        self.errors.run(NO_ROVER, lambda: self.scene.draw_rover(session.rover, session.arm_angles))

    def _draw_ground(self) -> None:
        self.errors.run("the ground is not drawn", self._build_ground)

    def _build_ground(self) -> None:
        session, tab = self.session, self.ground_tab
        heading = float(np.radians(tab.heading))
        ground = draw_ground(
            session.rover, session.terrain, tab.layer, heading, session.sweep_options()
        )
        self.scene.draw_ground(ground)
        tab.show_scale(ground)

    def _draw_prediction(self) -> None:
        """Colour the ground anew if its colours depend on what has changed."""
        if self.ground_tab.is_predicted:
            self._draw_ground()

    def _take_answer(self) -> None:
        """Show another answer: its paths and the chosen one's journey."""
        self.ground_tab.list_paths(self.session.answer.candidates)
        self._take_judgement()

    def _take_judgement(self) -> None:
        """Show how the path that is shown is judged now."""
        self._show_verdict()
        self._drive.restart()
        self.errors.run("the plots are not drawn", self._drive.draw_plots)
        self.errors.run("the paths are not drawn", self._drive.draw_paths)

    def _show_verdict(self) -> None:
        """Show the verdict as text, and draw nothing."""
        self.rover_tab.show_verdict(self._drive.show_verdict())

    def _judge_all_again(self) -> None:
        """After the rover has changed: judge the other candidates, and colour the ground."""
        refusal = self.session.refusal
        if refusal:
            self.rover_tab.show_values(self.session.rover)
        elif self.session.plan_again():
            self._take_answer()
            self._draw_prediction()

    def advance(self, seconds: float) -> None:
        """Play on; judge all candidates anew when the rover has not been changed for a while."""
        changed = self._changed_at
        if changed is not None and time.monotonic() - changed > REST:
            self._changed_at = None
            self.wishes.ask(self._judge_all_again, "all candidates")
        self._drive.advance(seconds)
