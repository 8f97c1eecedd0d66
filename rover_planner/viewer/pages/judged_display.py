# SPDX-License-Identifier: Apache-2.0
"""Brings judged scenarios onto the page: verdict, paths, rover, ground and the drive."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.planning.path_query import Candidate
from rover_planner.viewer.pages.base import Drawings
from rover_planner.viewer.pages.ground_painter import GroundPainter
from rover_planner.viewer.panel.board import BoardNotes
from rover_planner.viewer.panel.candidate_table import draw_candidates
from rover_planner.viewer.panel.dashboard import (
    describe_details,
    describe_failure,
    describe_verdict,
)
from rover_planner.viewer.panel.drive_tab import DriveTab, PlaybackControls
from rover_planner.viewer.panel.ground_tab import GroundTab
from rover_planner.viewer.panel.notices import ErrorNotice, JudgingNotice
from rover_planner.viewer.panel.plots import PLOTS, Curves, Plots
from rover_planner.viewer.panel.rover_tab import RoverTab
from rover_planner.viewer.scene.cameras import find_radius
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.before_after import (
    ChangeHistory,
    compare_drives,
    list_changes,
)
from rover_planner.viewer.state.candidate_rows import list_candidates
from rover_planner.viewer.state.failure import Explanation, Failure, explain
from rover_planner.viewer.state.path_limits import find_worst
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.session import ViewSession
from rover_planner.viewer.state.trajectory import MAX_VALUE, RoverState, Trajectory

NOTICE_DELAY = 0.2
"""Time without a result after which the page tells what it judges, and greys what is old [s]."""
MUCH_LARGER = 1.5
"""Ratio of the sizes of two rovers above which the cameras find a new place."""
DASHBOARD_PERIOD = 0.1
"""Time between two updates of dashboard and plots [s]; they take the page longer than poses."""
AT_FAILURE = 0.06
"""Time from a failure within which the rover is shown as it fails [s]; the scrubber has steps of
0.1 s."""
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
    controls: PlaybackControls
    rover_tab: RoverTab
    ground_tab: GroundTab
    show_candidates: Callable[[str], None]
    """Shows the table of the candidates, HTML."""


class JudgedDisplay:
    """Shows the last finished judgement of a session, as far as it differs from what is shown.

    The verdict is shown at once. What takes longer is asked of the drawings, which follow one by
    one. An error in one part is told on the page; the other parts are shown.
    """

    def __init__(
        self, session: ViewSession, playback: Playback, panels: Panels, painter: GroundPainter
    ):
        """Show nothing yet.

        Args:
            session: The session.
            playback: The drive along the shown path.
            panels: Where to show.
            painter: Colours the ground.
        """
        self._session, self._playback, self._painter = session, playback, painter
        self._panels, self._run = panels, panels.errors.run
        self._age = ("", "")
        """Why the shown verdict is old, and the notice, as they are shown."""
        self.history = ChangeHistory(session.shown)
        """The rovers before, and their drives."""
        self.why: Explanation | None = None
        """Why the shown path can be driven or not."""
        self._explained: Candidate | None = None
        """The path that `why` is about."""
        self._updated_at = 0.0

    @property
    def why_old(self) -> str:
        """Why the shown verdict is one of old values; empty if it is not."""
        return self._age[0]

    @property
    def failure(self) -> Failure | None:
        """The failure of the shown path; None if it has none."""
        return None if self.why is None else self.why.failure

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
            self.history.take(now)
            if now.answered is not before.answered:
                self._draw_predicted_ground()
            if now.around is not before.around:
                self._ask("the closed area is not drawn", self._draw_closed_area)
            if now.candidate is not before.candidate:
                self.show_path()
            elif now.answer is not before.answer:
                self._ask(NO_PATHS, self._draw_paths)
            self._ask(NO_LIST, self._list_candidates)

    def _show_scenario(self, before: Scenario, now: Scenario) -> None:
        """Show the rover for which was judged, and begin another path at its start."""
        if before.start is not now.start or before.goal is not now.goal:
            self._playback.go_to(0.0)
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
        self._panels.controls.set_drive(self._session.shown.trajectory)
        self._run("the path is not explained", self._explain)
        self._ask(NO_PATHS, self._draw_paths)
        self._ask("the failure is not shown", self._draw_failure)
        self._ask("the plots are not drawn", self._draw_plots)
        self._ask("the changes are not shown", self._show_changes)
        if self._panels.ground_tab.is_along_path:
            self._draw_predicted_ground()

    def show_verdict(self) -> None:
        """Show the verdict, or why a change was refused, as text.

        In the tab of the drive the broken limit, value and wheel stand above the board, all else
        below it, so that the board is seen without scrolling. In the tab of the rover they stand
        above the policies, and the reason, which may be long, below them.
        """
        shown, reason, panels = self._session.shown, self._session.shown.reason, self._panels
        passes, notes, old = shown.verdict.traversable, shown.trajectory.notes, self.why_old
        is_known = self.failure is not None and self._explained is shown.candidate
        failure = describe_failure(self.failure) if self.failure is not None and is_known else ""
        above = describe_verdict(passes, reason, "", "", shown.by_policy, old, failure=failure)
        panels.drive_tab.show_verdict(above)
        details = describe_details(reason if failure else "", shown.summary, notes)
        panels.drive_tab.show_below(details)
        below = (reason, *notes) if failure else notes
        panels.rover_tab.show_verdict(
            describe_verdict(
                passes, reason, "", shown.summary, shown.by_policy, old, below, failure
            )
        )
        panels.notice.show_refusal(self._session.refusal)

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
            self._panels.scene.paths.mark_old(self._old_paths())
            self._panels.scene.closed.mark_old(session.has_old_candidates)

    # What takes longer.

    def _ask(self, failure: str, draw: Callable[[], None]) -> None:
        """Draw something soon, and the next picture after it even if the rover stands."""

        def draw_with_picture() -> None:
            draw()
            self._panels.controls.outdated = True

        self._panels.drawings.ask(failure, draw_with_picture)

    def _draw_rover(self) -> None:
        self._panels.scene.draw_rover(self._session.rover, self._session.scenario.arm_angles)

    def _fit_cameras(self) -> None:
        shown = self._session.shown.candidate.poses[:, :2]
        self._panels.scene.fit_all(self._session.terrain, shown)

    def _draw_predicted_ground(self) -> None:
        """Colour the ground again if its layer depends on the rover, or is compared with it."""
        tab = self._panels.ground_tab
        if tab.is_predicted or tab.is_surveyed:
            self.draw_ground()

    def _draw_paths(self) -> None:
        """Draw all candidate paths over the ground, those with old verdicts grey."""
        session, scene = self._session, self._panels.scene
        shown, old = session.shown.index, self._old_paths()
        scene.paths.show(session.rover, session.terrain, session.shown.candidates, shown, old)
        scene.closed.mark_old(session.has_old_candidates)

    def _draw_closed_area(self) -> None:
        session = self._session
        self._panels.scene.closed.show(session.rover, session.terrain, session.shown.around)

    def _old_paths(self) -> set[int]:
        """Return the indices of the paths whose verdicts are of old values."""
        session, shown = self._session, self._session.shown.index
        others = set(range(len(session.shown.candidates))) - {shown}
        old = others if session.has_old_candidates else set()
        return old | {shown} if self.why_old else old

    def _list_candidates(self) -> None:
        """Show the table of the candidates, those with old verdicts grey."""
        shown = self._session.shown
        rows = list_candidates(shown, self._session.has_old_candidates)
        self._panels.show_candidates(draw_candidates(rows, shown.index))

    def _explain(self) -> None:
        """Find out where the shown path uses its limits and breaks one."""
        self.why = None  # an error must not leave that of another path
        self.why = explain(self._session.shown)
        self._explained = self._session.shown.candidate
        self.show_verdict()

    def _draw_failure(self) -> None:
        """Show where the shown path fails, if it does."""
        self._panels.drive_tab.show_failure(self.failure)
        self._panels.scene.failure.show(self._session.rover, self.failure)

    @property
    def _before(self) -> Trajectory | None:
        """The drive of the rover before along the shown path; None if there is none."""
        shown = self.history.reference_for(self._session.shown)
        return None if shown is None else shown.trajectory

    def _draw_plots(self) -> None:
        """Plot the values along the shown path, those of the drive before pale."""
        rover, trajectory, why = self._session.rover, self._session.shown.trajectory, self.why
        plots, old = self._panels.plots, None if self._before is None else _curves(self._before)
        if why is None:
            plots.set_curves(rover, _curves(trajectory), old)
            plots.lanes.set_limits(None)
            return
        limit = why.limits.lane("friction").limit.bound
        limit = math.inf if limit is None else limit  # speed servos have none
        now = _curves_between(why)
        plots.set_curves(rover, now, old, why.failure_at, limit)
        plots.lanes.set_limits(why.limits)

    def _show_changes(self) -> None:
        """Show what has changed of the rover and of its drive."""
        now, before = self._session.shown, self._before
        changed = list_changes(now.scenario.loaded, now.scenario.rover)
        differences = () if before is None else compare_drives(before, now.trajectory)
        self._panels.rover_tab.show_changes(changed, differences)

    # The drive.

    def go_to_failure(self) -> None:
        """Show the rover where the shown path is refused, and let the cameras look there."""
        if self.failure is not None:
            self._playback.go_to(self.failure.time)
            self._panels.controls.outdated = True
            self._panels.scene.cameras.look_at_failure(self._session.rover, self.failure)

    def seek_share(self, share: float) -> None:
        """Go to the time at which the rover is at a share, 0 to 1, of the lanes' distance."""
        if self.why is not None:
            limits = self.why.limits
            at = np.interp(share * limits.end, limits.rows.distance, limits.rows.time)
            self._playback.go_to(float(at))
            self._panels.controls.outdated = True

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s], and draw what has changed."""
        panels, playback, controls = self._panels, self._playback, self._panels.controls
        controls.release_scrubber()
        controls.outdated = playback.advance(seconds) or controls.outdated
        if not controls.outdated:
            return
        state = self._find_state()
        panels.scene.show(state)
        controls.outdated = False
        now = time.monotonic()
        if now - self._updated_at < DASHBOARD_PERIOD and playback.rate != 0.0:
            return
        self._updated_at = now
        panels.drive_tab.show(self._session.rover, state, playback.describe(), self._notes())
        controls.move_scrubber()
        if state is not None:
            panels.plots.move_cursor(state.distance)

    def _find_state(self) -> RoverState | None:
        """Return the state at the time of the playback; at a failure that at which it fails.

        The model may have been asked there between waypoints.
        """
        at, failure = self._playback.time, self.failure
        state = self._session.shown.trajectory.state_at(at)
        if state is None or failure is None or not failure.is_settled:
            return state
        if abs(at - failure.time) > AT_FAILURE:
            return state
        return replace(failure.state, spin=state.spin, energy=state.energy)

    def _notes(self) -> BoardNotes:
        """Return what the board shows besides the state."""
        has_slip = self._session.shown.trajectory.has_slip
        if self.why is None:
            return BoardNotes(has_slip)
        worst = find_worst(self.why.limits, self._playback.time)
        return BoardNotes(has_slip, worst, self.why.failing_link)


def _differ_in_size(one: Rover, other: Rover) -> bool:
    """Return whether a camera that shows one rover may stand inside the other."""
    small, large = sorted((find_radius(one), find_radius(other)))
    return large > MUCH_LARGER * small


def _curves_between(why: Explanation) -> Curves:
    """Return the curves of the plots with the poses between waypoints, while the rover stands."""
    rows = why.limits.rows
    lost = np.flatnonzero(~rows.prediction.settled)
    stands = slice(int(lost[0]) if lost.size else len(rows.distance))
    values = {
        name: np.nan_to_num(getattr(rows.prediction, name)[stands], posinf=MAX_VALUE)
        for name in PLOTS
    }
    return Curves(rows.distance[stands], values)


def _curves(trajectory: Trajectory) -> Curves:
    """Return the curves of the plots along a drive."""
    if not trajectory.length:
        return Curves(np.empty(0), {})
    values = {name: trajectory.series(name) for name in PLOTS}
    return Curves(trajectory.series("distance"), values)
