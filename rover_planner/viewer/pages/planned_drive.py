"""What moves on the page while it plans by itself: the journey of the path that is shown."""

import time

import numpy as np

from rover_planner.viewer.panel.board import describe_verdict
from rover_planner.viewer.panel.charts import CHARTS, Charts
from rover_planner.viewer.panel.drive_tab import DriveTab
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.session import ViewSession

BOARD_FRAME = 0.1
"""Time between two pictures of board and plots, which cost the page more than poses [s]."""


class PlannedDrive:
    """Plays a journey; `advance` is called for every picture."""

    def __init__(
        self,
        session: ViewSession,
        playback: Playback,
        scene: Scene,
        tab: DriveTab,
        charts: Charts,
    ):
        self._session, self._playback = session, playback
        self._scene, self._tab, self._charts = scene, tab, charts
        self._board_at = 0.0

    def show_verdict(self) -> str:
        """Show how the path is judged now; return that as HTML."""
        session, shown = self._session, self._session.shown
        verdict = shown.verdict
        text = describe_verdict(verdict.traversable, verdict.reason, session.refusal, shown.judged)
        self._tab.show_verdict(text)
        return text

    def restart(self) -> None:
        """Play the journey of the path that is shown now."""
        self._tab.take(self._session.shown.journey)

    def draw_plots(self) -> None:
        """Plot the path that is shown."""
        rover, journey = self._session.rover, self._session.shown.journey
        if journey.length:
            values = {name: journey.series(name) for name in CHARTS}
            self._charts.take(rover, journey.series("distance"), values)
        else:
            self._charts.take(rover, np.empty(0), {})

    def draw_paths(self) -> None:
        """Draw the candidate paths over the ground."""
        session = self._session
        self._scene.paths.show(
            session.rover, session.terrain, session.candidates, session.shown.index
        )

    def advance(self, seconds: float) -> None:
        """Move on by the time that passed for the visitor [s]."""
        self._tab.settle_scrubber()
        self._tab.moved = self._playback.advance(seconds) or self._tab.moved
        if not self._tab.moved:
            return
        frame = self._session.shown.journey.frame(self._playback.time)
        self._scene.show(frame)
        self._tab.moved = False
        now = time.monotonic()
        if now - self._board_at < BOARD_FRAME and self._playback.rate != 0.0:
            return
        self._board_at = now
        self._tab.show(self._session.rover, frame, self._playback.describe())
        self._tab.show_time()
        if frame is not None:
            self._charts.show(frame.distance)
