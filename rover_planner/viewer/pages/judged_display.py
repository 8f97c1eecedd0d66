# SPDX-License-Identifier: Apache-2.0
"""What the session judged, brought onto the page: verdict, paths, rover and ground."""

from collections.abc import Callable
from dataclasses import dataclass

from rover_physics.rover.model import Rover
from rover_planner.viewer.pages.change_desk import ChangeDesk
from rover_planner.viewer.pages.drawings import Drawings
from rover_planner.viewer.pages.ground_painter import GroundPainter
from rover_planner.viewer.pages.path_display import PathDisplay
from rover_planner.viewer.panel.error_notice import ErrorNotice
from rover_planner.viewer.panel.judging_notice import JudgingNotice
from rover_planner.viewer.panel.plots import Plots
from rover_planner.viewer.panel.reasons.candidate_table import CandidateTable
from rover_planner.viewer.panel.tabs.drive_tab import DriveTab
from rover_planner.viewer.panel.tabs.ground_tab import GroundTab
from rover_planner.viewer.panel.tabs.rover_tab import RoverTab
from rover_planner.viewer.scene.scene import Scene, find_radius
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.reasons.candidate_rows import list_candidates
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.session import ViewSession
from rover_planner.viewer.state.visitor_requests import Action

NOTICE_DELAY = 0.2
"""Time without a result after which the page tells what it judges, and greys what is old [s]."""
MUCH_LARGER = 1.5
"""Ratio of the sizes of two rovers above which the cameras find a new place."""
NO_ROVER, NO_GROUND = "the rover is not drawn", "the ground is not drawn"
NO_PATHS, NO_LIST = "the paths are not drawn", "the candidates are not listed"


@dataclass(frozen=True, eq=False)
class Panels:
    """Where on the page things are shown."""

    scene: Scene
    errors: ErrorNotice
    drawings: Drawings
    notice: JudgingNotice
    plots: Plots
    drive_tab: DriveTab
    rover_tab: RoverTab
    ground_tab: GroundTab
    candidates: CandidateTable


class JudgedDisplay:
    """Shows the last finished judgement of a session, as far as it differs from what is shown.

    The verdict is shown at once. What takes longer is asked of the drawings, which follow one by
    one. An error in one part is told on the page; the other parts are shown.
    """

    def __init__(
        self,
        session: ViewSession,
        playback: Playback,
        panels: Panels,
        painter: GroundPainter,
        changed: Callable[[], None],
    ):
        """Show nothing yet.

        Args:
            session: The session.
            playback: The drive along the shown path.
            panels: Where to show.
            painter: Colours the ground.
            changed: Called after a change of the rover was taken back.
        """
        self._session, self._playback, self._painter = session, playback, painter
        self._panels, self._run = panels, panels.errors.run
        self._age = ("", "")
        """Why the shown verdict is old, and the notice, as they are shown."""
        self.path = PathDisplay(session, playback, panels.scene, panels.drive_tab, panels.plots)
        self.changes = ChangeDesk(session, panels.rover_tab, changed)

    @property
    def why_old(self) -> str:
        """Why the shown verdict is one of old values; empty if it is not."""
        return self._age[0]

    def show_all(self) -> None:
        """Show everything, on a new page."""
        self.draw_ground()
        self._ask(NO_ROVER, self._draw_rover)
        self.show_inputs()
        self.show_path()
        self._ask(NO_LIST, self._list_candidates)
        self._panels.drawings.draw_all()

    def show_judged(self) -> None:
        """Take what was judged, and show it."""
        session, before = self._session, self._session.shown
        try:
            session.take_finished()
        finally:
            now = session.shown
            self.show_verdict()
            if now.scenario is not before.scenario:
                self._show_scenario(before.scenario, now.scenario)
            self.changes.take_judged()
            if now.answered is not before.answered:
                self._draw_predicted_ground()
            if now.way is not before.way:
                self._ask("the searched ground is not drawn", self.path.draw_search)
            if now.candidate is not before.candidate:
                self.show_path()
            elif now.answer is not before.answer:
                self._ask(NO_PATHS, self._draw_paths)
            self._ask(NO_LIST, self._list_candidates)

    def _show_scenario(self, before: Scenario, now: Scenario) -> None:
        """Show the rover for which was judged, and begin another path at its start."""
        if before.start is not now.start or before.goal is not now.goal:
            self._playback.pause()
            self._playback.seek(0.0)
        self._ask(NO_ROVER, self._draw_rover)
        if before.loaded is not now.loaded and _differ_in_size(before.loaded, now.loaded):
            self._ask("the cameras are not moved", self._fit_cameras)  # after the rover

    def show_inputs(self) -> None:
        """Show in all inputs what is wanted, where no visitor has chosen it."""
        wanted, panels = self._session.wanted, self._panels
        panels.rover_tab.show_rover(wanted.loaded, wanted.rover, wanted.arm_angles)
        panels.ground_tab.show_options(wanted.options)

    def show_path(self) -> None:
        """Show the shown path as it was judged last: first the verdict, then the drawings."""
        self.show_verdict()
        self.path.play_shown_path()
        self._run("the path is not explained", self.path.explain)
        self._ask(NO_PATHS, self._draw_paths)
        self._ask("the failure is not shown", self.path.draw_failure)
        self._ask("the plots are not drawn", self._draw_plots)
        self._ask("the changes are not shown", self.changes.show)
        if self._panels.ground_tab.is_along_path:
            self._draw_predicted_ground()

    def show_verdict(self) -> None:
        """Show the verdict, or why a change was refused, as text."""
        self._panels.rover_tab.show_verdict(self.path.show_verdict(self.why_old))
        self._panels.notice.show_refusal(self._session.refusal)

    def draw_ground(self) -> None:
        """Begin to colour the ground."""
        now = self._session.shown
        path = now.candidate.poses
        self._run(NO_GROUND, lambda: self._painter.paint(now.scenario, path))

    def take_ground(self) -> None:
        """Show the coloured ground if it is finished."""
        if self._painter.work.has_news:
            self._run(NO_GROUND, self._painter.show_painted)

    def show_work(self) -> None:
        """Show what is worked on, and whether the verdict is an old one meanwhile."""
        session, progress, old, notice = self._session, self._session.progress, "", ""
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
            self.show_verdict()
            self._panels.notice.show(notice, progress is not None)
            self.path.mark_old(bool(old))

    def _ask(self, failure: str, draw: Action) -> None:
        """Draw something soon, and the next picture after it even if the rover stands."""

        def draw_with_picture() -> None:
            draw()
            self._panels.drive_tab.outdated = True

        self._panels.drawings.ask(failure, draw_with_picture)

    def _draw_rover(self) -> None:
        self._panels.scene.draw_rover(self._session.rover, self._session.scenario.arm_angles)

    def _fit_cameras(self) -> None:
        shown = self._session.shown.candidate.poses[:, :2]
        self._panels.scene.fit_all(self._session.terrain, shown)

    def _draw_plots(self) -> None:
        self.path.draw_plots(self.changes.before)

    def _draw_predicted_ground(self) -> None:
        """Colour the ground again if its layer depends on the rover, or is compared with it."""
        tab = self._panels.ground_tab
        if tab.is_predicted or tab.is_surveyed:
            self.draw_ground()

    def _draw_paths(self) -> None:
        self.path.draw_paths(bool(self.why_old))

    def _list_candidates(self) -> None:
        """Show the table of the candidates, those with old verdicts grey."""
        session, shown = self._session, self._session.shown.index
        others = session.has_old_candidates
        old = [others and k != shown for k in range(len(session.shown.candidates))]
        rows = list_candidates(session.shown.candidates, session.shown.answer.nearest, old)
        self._panels.candidates.show(rows, shown)


def _differ_in_size(one: Rover, other: Rover) -> bool:
    """Return whether a camera that shows one rover may stand inside the other."""
    small, large = sorted((find_radius(one), find_radius(other)))
    return large > MUCH_LARGER * small
