# SPDX-License-Identifier: Apache-2.0
"""The shown path on the page: verdict, plots, lines over the ground, and the drive along it."""

import math
import time
from dataclasses import replace

import numpy as np

from rover_planner.planning.path_query import Candidate
from rover_planner.viewer.panel.board import BoardNotes
from rover_planner.viewer.panel.dashboard import describe_details, describe_verdict
from rover_planner.viewer.panel.plots import PLOTS, Curves, Plots
from rover_planner.viewer.panel.reasons.failure_notice import describe_failure
from rover_planner.viewer.panel.tabs.drive_tab import DriveTab
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.reasons.failure import Explanation, explain
from rover_planner.viewer.state.reasons.path_limits import find_worst
from rover_planner.viewer.state.session import ViewSession
from rover_planner.viewer.state.trajectory import MAX_VALUE, RoverState, Trajectory

DASHBOARD_PERIOD = 0.1
"""Time between two updates of dashboard and plots [s]; they take the page longer than poses."""


AT_FAILURE = 0.06
"""Time from a failure within which the rover is shown as it fails [s]; the scrubber has steps of
0.1 s."""


class PathDisplay:
    """Shows the path that the session shows, and plays the drive along it."""

    def __init__(
        self,
        session: ViewSession,
        playback: Playback,
        scene: Scene,
        tab: DriveTab,
        plots: Plots,
    ):
        """Show nothing yet."""
        self._session, self._playback = session, playback
        self._scene, self._tab, self._plots = scene, tab, plots
        self._updated_at = 0.0
        self._old = ""
        """Why the shown verdict is an old one, as it was shown last."""
        self.why: Explanation | None = None
        """Why the shown path can be driven or not."""
        self._explained: Candidate | None = None
        """The path that `why` is about."""

    def show_verdict(self, old: str = "") -> str:
        """Show the verdict in the tab of the drive; return all of it in one piece, as HTML.

        In the tab the broken limit, value and wheel stand above the board, all else below it, so
        that the board is seen without scrolling. In one piece they stand above the policies, and
        the reason, which may be long, below them.

        Args:
            old: Why it is a verdict on old values; empty if it is not.
        """
        session, shown = self._session, self._session.shown
        self._old, reason, notes = old, session.shown.reason, shown.trajectory.notes
        judged = shown.verdict.traversable, reason, ""
        failure = self.why.failure if self.why and self._explained is shown.candidate else None
        words = "" if failure is None else describe_failure(failure)
        self._tab.show_verdict(
            describe_verdict(*judged, "", shown.by_policy, old, failure=words),
            describe_details(reason if words else "", shown.summary, notes),
        )
        below = (reason, *notes) if words else notes
        return describe_verdict(*judged, shown.summary, shown.by_policy, old, below, failure=words)

    def play_shown_path(self) -> None:
        """Play the shown path, from the same distance driven as before."""
        self._tab.set_trajectory(self._session.shown.trajectory)

    def explain(self) -> None:
        """Find out where the shown path uses its limits and breaks one."""
        self.why = None  # an error must not leave that of another path
        self.why = explain(self._session.shown)
        self._explained = self._session.shown.candidate
        self.show_verdict(self._old)

    def draw_failure(self) -> None:
        """Show where the shown path fails, if it does."""
        failure = None if self.why is None else self.why.failure
        self._tab.show_failure(failure)
        self._scene.failure.show(self._session.rover, failure)

    def draw_plots(self, before: Trajectory | None = None) -> None:
        """Plot the values along the shown path, those of the drive before pale."""
        rover, trajectory, why = self._session.rover, self._session.shown.trajectory, self.why
        old = None if before is None else _curves(before)
        failure_at = None if why is None else why.failure_at
        now = _curves(trajectory) if why is None else _curves_between(why)
        limit = None if why is None else why.limits.lane("friction").limit.bound
        on_servos = why is not None and limit is None
        self._plots.set_curves(rover, now, old, failure_at, math.inf if on_servos else limit)
        self._plots.lanes.set_limits(None if why is None else why.limits)

    def go_to_failure(self) -> None:
        """Show the rover where the shown path is refused, and let the cameras look there."""
        if self.why is None or self.why.failure is None:
            return
        self._playback.pause()
        self._playback.seek(self.why.failure.time)
        self._tab.outdated = True
        self._scene.look_at_failure(self._session.rover, self.why.failure)

    def draw_paths(self, path_is_old: bool = False) -> None:
        """Draw all candidate paths over the ground, those with old verdicts grey."""
        session = self._session
        self._scene.paths.show(
            session.rover,
            session.terrain,
            session.shown.candidates,
            session.shown.index,
            self._old_paths(path_is_old),
        )
        self._scene.search.mark_old(session.has_old_candidates)

    def draw_search(self) -> None:
        """Draw the area that is closed in, if no way was found, and what was searched."""
        self._scene.search.show(
            self._session.rover, self._session.terrain, self._session.shown.way
        )

    def mark_old(self, path_is_old: bool) -> None:
        """Grey the lines of other paths with old verdicts, and of the shown path if it has one.

        A search for old values is grey, too.
        """
        self._scene.paths.mark_old(self._old_paths(path_is_old))
        self._scene.search.mark_old(self._session.has_old_candidates)

    def _old_paths(self, path_is_old: bool) -> set[int]:
        """Return the indices of the paths whose verdicts are of old values."""
        session = self._session
        index, others = session.shown.index, session.has_old_candidates
        old = {k for k in range(len(session.shown.candidates)) if others and k != index}
        return old | {index} if path_is_old else old

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s], and draw what has changed."""
        self._tab.release_scrubber()
        self._tab.outdated = self._playback.advance(seconds) or self._tab.outdated
        if not self._tab.outdated:
            return
        state = self._state()
        self._scene.show(state)
        self._tab.outdated = False
        now = time.monotonic()
        if now - self._updated_at < DASHBOARD_PERIOD and self._playback.rate != 0.0:
            return
        self._updated_at = now
        self._tab.show(self._session.rover, state, self._playback.describe(), self._notes())
        self._tab.move_scrubber()
        if state is not None:
            self._plots.move_cursor(state.distance)

    def _state(self) -> RoverState | None:
        """Return the state at the time of the playback; at a failure that at which it fails.

        The model may have been asked there between waypoints.
        """
        time_shown = self._playback.time
        state = self._session.shown.trajectory.state_at(time_shown)
        failure = None if self.why is None else self.why.failure
        if state is None or failure is None or not failure.is_settled:
            return state
        if abs(time_shown - failure.time) > AT_FAILURE:
            return state
        return replace(failure.state, spin=state.spin, energy=state.energy)

    def _notes(self) -> BoardNotes:
        """Return what the board shows besides the state."""
        has_slip = self._session.shown.trajectory.has_slip
        if self.why is None:
            return BoardNotes(has_slip)
        worst = find_worst(self.why.limits, self._playback.time)
        return BoardNotes(has_slip, worst, self.why.failing_link)


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
