# SPDX-License-Identifier: Apache-2.0
"""The page that plans: its tabs, and what visitors can request of the session behind it."""

import time
from collections.abc import Callable, Mapping

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import RoverValue
from rover_planner.viewer.browser.link import PageLink, read_link
from rover_planner.viewer.pages.base import PageBase
from rover_planner.viewer.pages.ground_painter import GroundPainter
from rover_planner.viewer.pages.judged_display import JudgedDisplay, Panels
from rover_planner.viewer.pages.sharing import Sharing
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.ground_tab import GroundActions, GroundTab
from rover_planner.viewer.panel.header import Chip, play_chip, verdict_chip
from rover_planner.viewer.panel.notices import JudgingNotice
from rover_planner.viewer.panel.rover_tab import RoverActions, RoverTab
from rover_planner.viewer.state.context import Context, describe_scenario
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.session import ViewSession
from rover_planner.viewer.state.survey_layers import ShownSurvey

DRAWING_TIME, DRAWING_POLL = 0.2, 0.002
"""Longest time for which judging waits for the drawings, and between two looks at them [s]."""
REPLAN_DELAY = 0.5
"""Time from the last change of the rover until all candidates are judged again [s]."""


class Page(PageBase):
    """Shows what the session judges in the background, and plays the path that is shown.

    The page's own thread asks for judgements and takes them; it waits for none.
    """

    def __init__(
        self,
        session: ViewSession,
        host: str = "127.0.0.1",
        port: int = 8080,
        survey: ShownSurvey | None = None,
    ):
        """Start to serve a session.

        Args:
            session: The session.
            host: Address to serve on.
            port: Port to serve on; 0 takes a free one.
            survey: A survey of rover and ground, whose layers are offered.
        """
        self._survey = survey
        self.playback = Playback()
        self._changed_at: float | None = None
        """When the rover was changed last [s]; None if all candidates are judged for it."""
        super().__init__(session, host, port)
        self._painter = GroundPainter(
            self.scene,
            self.ground_tab,
            lambda: self.requests.add(self.judged.take_ground, "painted"),
            survey,
        )
        self.judged = JudgedDisplay(session, self.playback, self._panels, self._painter)
        self.drive_tab.go_to_failure = self.judged.go_to_failure
        session.judge_in_background(self._show_and_wait)
        self.judged.show_all()
        self.start()

    def fill_panel(self) -> None:
        """Add the notice of what is judged, and the tabs."""
        gui, add = self.server.gui, self.requests.add
        notice = JudgingNotice(
            gui,
            cancel=lambda: add(self._cancel, "cancel"),
            judge_again=lambda: add(self._judge_again, "judge again"),
        )
        tabs = gui.add_tab_group()
        self.drive_tab = DriveTab(gui, tabs.add_tab("Drive"), self.requests, self.playback)
        self.rover_tab = RoverTab(gui, tabs.add_tab("Rover"), self._rover_actions())
        with tabs.add_tab("Ground and path"):
            self.candidates = gui.add_html("")
            names = () if self._survey is None else self._survey.names
            self.ground_tab = GroundTab(gui, self._ground_actions(), surveyed=names)
        with tabs.add_tab("Share"):
            self.sharing = Sharing(
                self.server, self.requests, self.session, self.playback, self.ground_tab
            )
        assert self.drive_tab.controls is not None
        self._panels = Panels(
            self.scene,
            self.errors,
            self.drawings,
            notice,
            self.plots,
            self.drive_tab,
            self.drive_tab.controls,
            self.rover_tab,
            self.ground_tab,
            lambda table: setattr(self.candidates, "content", table),
        )

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
            undo=lambda: add(self._undo, "undo"),
            reset=lambda: add(lambda: self._restore(self.session.wanted.loaded, {}), "reset"),
        )

    def _ground_actions(self) -> GroundActions:
        add = self.requests.add
        return GroundActions(
            set_options=lambda **changes: add(lambda: self._change_options(**changes)),
            recolour=lambda: add(self.judged.draw_ground, "colours"),
            show_forces=lambda visible: add(lambda: self.scene.show_forces(visible)),
            show_between=lambda visible: add(lambda: self.scene.failure.show_between(visible)),
        )

    @property
    def is_busy(self) -> bool:
        """True if something is judged, or judged and not shown yet."""
        works = self.session, self._painter.work
        is_judged = any(work.progress is not None or work.has_news for work in works)
        return is_judged or self.is_drawing  # in this order: what was taken is drawn

    def close(self) -> None:
        """End the page and its threads in the background."""
        super().close()
        self.session.close()
        self._painter.work.close()

    def describe_context(self) -> tuple[Context, tuple[Chip, ...]]:
        """Return what is judged, the verdict, and what is played."""
        session, playback = self.session, self.playback
        return describe_scenario(session.shown.scenario, session.ground_name), (
            verdict_chip(session.shown.verdict.traversable, self.judged.why_old),
            play_chip(playback.rate != 0.0, playback.describe()),
        )

    def path_to_look_at(self) -> Floats:
        """Return x and y (n, 2) [m] of the shown path."""
        return self.session.shown.candidate.poses[:, :2]

    # Requests of visitors.

    def hear(self, word: str, rest: str) -> None:
        """Open a link, show a path, or go to a place of lanes and plots."""
        if word == "open":
            link = read_link(rest)
            if link is not None:
                self.open_link(link)
        elif word == "show":
            self.session.show_candidate(int(rest) - 1)
        elif word == "seek":
            self.judged.seek_share(float(rest))

    def open_link(self, link: PageLink) -> None:
        """Judge what a link holds, and show it."""
        self.sharing.open(link)
        self.judged.show_inputs()
        self.judged.draw_ground()
        self.judged.show_verdict()

    def click(self, point: Floats | None, shift: bool) -> None:
        """Set goal or start, and plan."""
        if point is None:
            raise PlanningError("the click is beside the known ground")
        self.plan(point, "start" if shift else self.ground_tab.click_sets)

    def plan(self, point: Floats, sets: str = "goal") -> None:
        """Plan with a point (2,) [m] as the "goal" or the "start"."""
        if sets == "goal":
            self.session.plan_to(point)
        else:
            self.session.plan_from(point)
        self.judged.show_verdict()

    def show_refusal(self, reason: str) -> None:
        """Show, as text, why a request was refused."""
        self.session.refusal = reason
        self.judged.show_verdict()

    def _change_value(self, value: RoverValue, number: float) -> None:
        self.session.change_rover(value.keys, number)
        self._note_change()

    def _turn_arm(self, joint: str, angle: float) -> None:
        self.session.change_arm(joint, angle)
        self._note_change()

    def _note_change(self) -> None:
        """Show the verdict after a change of the rover; soon all candidates are judged."""
        self._changed_at = time.monotonic()
        self.judged.show_verdict()

    def _undo(self) -> None:
        """Take the last rover again.

        Raises:
            PlanningError: There is none.
        """
        before = self.judged.history.undo(self.session.wanted)
        if before is None:
            raise PlanningError("there is no change of this rover on these paths to undo")
        self._restore(before.scenario.rover, before.scenario.arm_angles)

    def _restore(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        self.session.restore_rover(rover, arm_angles)
        self.judged.show_inputs()
        self._note_change()

    def _change_options(self, **changes: object) -> None:
        self.session.change_options(**changes)
        self.judged.show_verdict()

    def _load(self, read: Callable[[], Rover]) -> None:
        self.session.take_rover(read())
        self.judged.show_inputs()
        self.judged.show_verdict()

    def _plan_again(self) -> None:
        """After a change of the rover: judge all candidates, or put a refused value back."""
        if self.session.refusal:
            self.judged.show_inputs()
        elif not self.session.is_stopped:
            self.session.plan_again()

    def _cancel(self) -> None:
        self.session.cancel()
        self._painter.work.cancel()

    def _judge_again(self) -> None:
        self.session.plan_again()
        self.judged.show_verdict()

    # What was judged.

    def _show_and_wait(self) -> None:
        """Request that what was judged is shown; in the judging thread.

        What is judged next, the other policies, would slow down the drawings, so it waits for
        them; a newer change does not.
        """
        self.requests.add(self._take_judged, "judged")
        wanted, end = self.session.wanted, time.monotonic() + DRAWING_TIME
        while self.session.has_news or self.is_drawing:
            if self.session.wanted is not wanted or time.monotonic() > end:
                return
            time.sleep(DRAWING_POLL)

    def _take_judged(self) -> None:
        if self.session.has_news:
            with self.server.atomic():
                self.errors.run("not judged", self._show_judged)

    def _show_judged(self) -> None:
        """Show what was judged; a refused value is put back soon."""
        try:
            self.judged.show_judged()
        finally:
            if self.session.refusal:
                self._changed_at = time.monotonic()
            self.sharing.go_on()
            self._panels.controls.outdated = True

    def add_due_requests(self) -> None:
        """Request that all candidates are judged, REPLAN_DELAY after a change of the rover.

        It also tells what is worked on, with or without pictures.
        """
        self.errors.run("the progress is not shown", self.judged.show_work)
        changed = self._changed_at
        is_due = changed is not None and time.monotonic() - changed > REPLAN_DELAY
        if is_due and self.session.progress is None:
            self._changed_at = None
            self.requests.add(self._plan_again, "plan again")

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s]."""
        self.judged.advance(seconds)
