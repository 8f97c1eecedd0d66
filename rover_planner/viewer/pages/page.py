"""The page that plans: its tabs, and what visitors can request of the session behind it."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.studies.rover_values import RoverValue
from rover_planner.viewer.pages.ground_painter import GroundPainter
from rover_planner.viewer.pages.page_base import PageBase
from rover_planner.viewer.pages.path_display import PathDisplay
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.ground_tab import GroundActions, GroundTab
from rover_planner.viewer.panel.judging_notice import JudgingNotice
from rover_planner.viewer.panel.rover_tab import RoverActions, RoverTab
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.session import ViewSession

REPLAN_DELAY = 0.5
"""Time from the last change of the rover until all candidates are judged again [s]."""
NOTICE_DELAY = 0.2
"""Time without a result after which the page tells what it judges, and greys what is old [s]."""
NO_ROVER, NO_GROUND = "the rover is not drawn", "the ground is not drawn"
NO_PATHS = "the paths are not drawn"


class Page(PageBase):
    """Shows what the session judges in the background, and plays the path that is shown.

    The page's own thread asks for judgements and takes them; it waits for none.
    """

    def __init__(self, session: ViewSession, host: str = "127.0.0.1", port: int = 8080):
        """Start to serve a session; port 0 takes a free one."""
        self.playback = Playback()
        self._changed_at: float | None = None
        """When the rover was changed last [s]; None if all candidates are judged for it."""
        self._age = ("", "")
        """Why the shown verdict is old, and the notice, as they are shown."""
        super().__init__(session, host, port)
        self._display = PathDisplay(session, self.playback, self.scene, self.drive_tab, self.plots)
        add = self.requests.add
        session.judge_in_background(lambda: add(self._take_judged, "judged"))
        self._painter = GroundPainter(
            self.scene, self.ground_tab, lambda: add(self._take_ground, "painted")
        )
        self._draw_ground()
        self._draw_rover()
        self.rover_tab.set_rover(session.rover)
        self._show_answer()
        self.start()

    @property
    def is_busy(self) -> bool:
        """Whether something is judged, or judged and not shown yet."""
        works = self.session, self._painter.work
        return any(work.progress is not None or work.has_news for work in works)

    def end_work(self) -> None:
        """End both threads in the background."""
        self.session.close()
        self._painter.work.close()

    def add_notices(self) -> None:
        """Add the notice of what is judged."""
        add = self.requests.add
        self._notice = JudgingNotice(
            self.server.gui,
            cancel=lambda: add(self._cancel, "cancel"),
            judge_again=lambda: add(self._judge_again, "judge again"),
        )

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
            current=lambda: self.session.wanted.rover,
        )

    def _ground_actions(self) -> GroundActions:
        add = self.requests.add
        return GroundActions(
            choose_path=lambda index: add(lambda: self._choose_path(index), "path"),
            set_options=lambda **changes: add(lambda: self._change_options(**changes)),
            recolour=lambda: add(self._draw_ground, "colours"),
            show_forces=lambda visible: add(lambda: self.scene.show_forces(visible)),
            follow=lambda follows: add(lambda: setattr(self.scene, "follows", follows)),
            show_asked=lambda visible: add(lambda: self.scene.search.show_asked(visible)),
        )

    # Requests of visitors.

    def click(self, point: np.ndarray | None, shift: bool) -> None:
        """Set goal or start, and plan."""
        if point is None:
            self.show_refusal("the click is beside the known ground")
        else:
            self.plan(point, "start" if shift else self.ground_tab.click_sets)

    def plan(self, point: np.ndarray, sets: str = "goal") -> None:
        """Plan with a point (2,) [m] as the "goal" or the "start"."""
        if sets == "goal":
            self.session.plan_to(point)
        else:
            self.session.plan_from(point)
        self._show_verdict()

    def show_refusal(self, reason: str) -> None:
        """Show, as text, why a request was refused."""
        self.session.refusal = reason
        self._show_verdict()

    def _change_value(self, value: RoverValue, number: float) -> None:
        self.session.change_rover(value.keys, number)
        self._changed_at = time.monotonic()
        self._show_verdict()

    def _turn_arm(self, joint: str, angle: float) -> None:
        self.session.change_arm(joint, angle)
        self._changed_at = time.monotonic()
        self._show_verdict()

    def _choose_path(self, index: int | None) -> None:
        self.session.show_candidate(self.session.answer.nearest if index is None else index)

    def _change_options(self, **changes: object) -> None:
        self.session.change_options(**changes)
        self._show_verdict()

    def _load(self, read: Callable[[], Rover]) -> None:
        self.session.take_rover(read())
        self._show_verdict()

    def _plan_again(self) -> None:
        """After a change of the rover: judge all candidates, or put a refused value back."""
        if self.session.refusal:
            self.rover_tab.show_values(self.session.wanted.rover)
        elif not self.session.is_stopped:
            self.session.plan_again()

    def _cancel(self) -> None:
        self.session.cancel()
        self._painter.work.cancel()

    def _judge_again(self) -> None:
        self.session.plan_again()
        self._show_verdict()

    # From the threads in the background onto the page.

    def _take_judged(self) -> None:
        if self.session.has_news:
            self.errors.run("not judged", self._show_judged)

    def _show_judged(self) -> None:
        """Show what was judged, as far as it differs from what is shown."""
        session, before = self.session, self.session.finished
        try:
            session.take_finished()
        finally:
            now = session.finished
            if session.refusal:
                self._changed_at = time.monotonic()
            self._show_verdict()
            if now.scenario is not before.scenario:
                self._show_scenario(before.scenario, now.scenario)
            if now.answer is not before.answer:
                self.ground_tab.list_paths(now.answer, now.shown.index)
            if now.answered is not before.answered:
                self._draw_predicted_ground()
            if now.way is not before.way:
                self._draw_search()
            if now.shown.candidate is not before.shown.candidate:
                self._show_path()
            elif now.answer is not before.answer:
                self.errors.run(NO_PATHS, self._draw_paths)

    def _show_scenario(self, before: Scenario, now: Scenario) -> None:
        """Show the rover for which was judged, and begin another path at its start."""
        if before.start is not now.start or before.goal is not now.goal:
            self.playback.pause()
            self.playback.seek(0.0)
        if before.loaded is not now.loaded:
            self.rover_tab.set_rover(self.session.wanted.rover)
        if not _look_alike(before.rover, now.rover):
            self._draw_rover()
        elif before.arm_angles is not now.arm_angles:
            self.errors.run(NO_ROVER, lambda: self.scene.turn_arm(now.arm_angles))

    def _take_ground(self) -> None:
        if self._painter.work.has_news:
            self.errors.run(NO_GROUND, self._painter.show_painted)

    def _draw_ground(self) -> None:
        self.errors.run(NO_GROUND, lambda: self._painter.paint(self.session.finished.scenario))

    def _draw_rover(self) -> None:
        session = self.session
        self.errors.run(NO_ROVER, lambda: self.scene.draw_rover(session.rover, session.arm_angles))

    def _draw_predicted_ground(self) -> None:
        """Colour the ground again if its layer is predicted for the rover."""
        if self.ground_tab.is_predicted:
            self._draw_ground()

    def _show_answer(self) -> None:
        """Show another answer: the list of its paths and the path that is shown."""
        self.ground_tab.list_paths(self.session.answer, self.session.shown.index)
        self._show_path()

    def _show_path(self) -> None:
        """Show the shown path as it was judged last: first the verdict, then the drawings."""
        self._show_verdict()
        self._display.play_shown_path()
        self.errors.run("the plots are not drawn", self._display.draw_plots)
        self.errors.run(NO_PATHS, self._draw_paths)

    def _draw_search(self) -> None:
        self.errors.run("the searched ground is not drawn", self._display.draw_search)

    def _draw_paths(self) -> None:
        self._display.draw_paths()
        self._display.mark_old(bool(self._age[0]))

    def _show_verdict(self) -> None:
        """Show the verdict, or why a change was refused, as text."""
        self.rover_tab.show_verdict(self._display.show_verdict(self._age[0]))

    def _show_age(self) -> None:
        """Show what is worked on, and whether the verdict is an old one meanwhile."""
        session, progress, old, notice = self.session, self.session.progress, "", ""
        in_work = progress is not None
        progress = progress or self._painter.work.progress
        if progress is not None and progress.seconds > NOTICE_DELAY:
            notice = f"{progress.describe()} ... {int(progress.seconds)} s"
            old = progress.describe() + " ..." if in_work else ""
        elif session.is_stopped:
            notice = "stopped: not all paths and policies were judged"
            old = "the judgement was stopped"
        old = old if session.is_outdated else ""
        if (old, notice) != self._age:
            self._age = old, notice
            self._show_verdict()
            self._notice.show(notice, progress is not None)
            self._display.mark_old(bool(old))

    def add_due_requests(self) -> None:
        """Request that all candidates are judged, REPLAN_DELAY after a change of the rover.

        It also tells what is worked on, with or without pictures.
        """
        self.errors.run("the progress is not shown", self._show_age)
        changed = self._changed_at
        is_due = changed is not None and time.monotonic() - changed > REPLAN_DELAY
        if is_due and self.session.progress is None:
            self._changed_at = None
            self.requests.add(self._plan_again, "plan again")

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s]."""
        self._display.advance(seconds)


def _look_alike(one: Rover, other: Rover) -> bool:
    """Return whether two rovers are drawn the same."""
    wheel = replace(one.wheel, max_torque=other.wheel.max_torque)
    friction, speed, limits = other.friction, other.nominal_speed, other.limits
    return (
        replace(one, wheel=wheel, friction=friction, nominal_speed=speed, limits=limits) == other
    )
