"""The shown path on the page: verdict, plots, lines over the ground, and the drive along it."""

import time

import numpy as np

from rover_planner.viewer.panel.dashboard import describe_verdict
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.panel.plots import PLOTS, Plots
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.session import ViewSession

DASHBOARD_PERIOD = 0.1
"""Time between two updates of dashboard and plots [s]; they take the page longer than poses."""


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

    def show_verdict(self, old: str = "") -> str:
        """Show the verdict in the tab of the drive; return it as HTML.

        Args:
            old: Why it is a verdict on old values; empty if it is not.
        """
        session, shown = self._session, self._session.shown
        verdict = shown.verdict
        text = describe_verdict(
            verdict.traversable,
            session.finished.reason,
            session.refusal,
            shown.summary,
            shown.by_policy,
            old,
        )
        self._tab.show_verdict(text)
        return text

    def play_shown_path(self) -> None:
        """Play the shown path, from the same share of the drive as before."""
        self._tab.set_trajectory(self._session.shown.trajectory)

    def draw_plots(self) -> None:
        """Plot the values along the shown path."""
        rover, trajectory = self._session.rover, self._session.shown.trajectory
        if trajectory.length:
            values = {name: trajectory.series(name) for name in PLOTS}
            self._plots.set_curves(rover, trajectory.series("distance"), values)
        else:
            self._plots.set_curves(rover, np.empty(0), {})

    def draw_paths(self) -> None:
        """Draw all candidate paths over the ground."""
        session = self._session
        self._scene.paths.show(
            session.rover, session.terrain, session.candidates, session.shown.index
        )

    def draw_search(self) -> None:
        """Draw the area that is closed in, if no way was found, and what was searched."""
        self._scene.search.show(
            self._session.rover, self._session.terrain, self._session.finished.way
        )

    def mark_old(self, path_is_old: bool) -> None:
        """Grey the lines of other paths with old verdicts, and of the shown path if it has one.

        A search for old values is grey, too.
        """
        session = self._session
        index = session.shown.index
        others = session.has_old_candidates
        old = {k for k in range(len(session.candidates)) if others and k != index}
        self._scene.paths.mark_old(old | {index} if path_is_old else old)
        self._scene.search.mark_old(others)

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s], and draw what has changed."""
        self._tab.release_scrubber()
        self._tab.outdated = self._playback.advance(seconds) or self._tab.outdated
        if not self._tab.outdated:
            return
        state = self._session.shown.trajectory.state_at(self._playback.time)
        self._scene.show(state)
        self._tab.outdated = False
        now = time.monotonic()
        if now - self._updated_at < DASHBOARD_PERIOD and self._playback.rate != 0.0:
            return
        self._updated_at = now
        self._tab.show(self._session.rover, state, self._playback.describe())
        self._tab.move_scrubber()
        if state is not None:
            self._plots.move_cursor(state.distance)
