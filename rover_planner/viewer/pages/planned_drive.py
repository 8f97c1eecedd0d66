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

    def take_judgement(self) -> str:
        """Show how the path is judged now; return that as HTML."""
        session, shown = self._session, self._session.shown
        journey = shown.journey
        self._tab.take(journey)
        if journey.length:
            values = {name: journey.series(name) for name in CHARTS}
            self._charts.take(session.rover, journey.series("distance"), values)
        else:
            self._charts.take(session.rover, np.empty(0), {})
        self._scene.paths.show(session.rover, session.terrain, session.answer, shown.candidate)
        verdict = shown.verdict
        text = describe_verdict(verdict.traversable, verdict.reason, session.refusal, shown.judged)
        self._tab.show_verdict(text)
        return text

    def advance(self, seconds: float) -> None:
        """Move on by the time that passed for the visitor [s]."""
        self._tab.settle_scrubber()
        moved = self._playback.advance(seconds) or self._tab.moved
        if not moved:
            return
        self._tab.moved = False
        frame = self._session.shown.journey.frame(self._playback.time)
        self._scene.show(frame)
        now = time.monotonic()
        if now - self._board_at < BOARD_FRAME and self._playback.rate != 0.0:
            return
        self._board_at = now
        self._tab.show(self._session.rover, frame, self._playback.describe())
        self._tab.show_time()
        if frame is not None:
            self._charts.show(frame.distance)
