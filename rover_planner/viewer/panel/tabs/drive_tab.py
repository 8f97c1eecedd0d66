# SPDX-License-Identifier: Apache-2.0
"""The tab of the drive: playback, verdict and the dashboard of the paper's Figure 5."""

import time
from typing import Any

from rover_physics.rover.model import Rover
from rover_planner.viewer.panel.board import BoardNotes
from rover_planner.viewer.panel.controls import (
    PAUSE_BUTTONS,
    PLAY_BUTTONS,
    STEP_BUTTONS,
    PlaybackActions,
    PlaybackControls,
)
from rover_planner.viewer.panel.dashboard import draw_dashboard, draw_empty_dashboard
from rover_planner.viewer.panel.reasons.failure_notice import FailureButton
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.reasons.failure import Failure
from rover_planner.viewer.state.trajectory import RoverState, Trajectory
from rover_planner.viewer.state.visitor_requests import Action, VisitorRequests

SCRUB_HOLD = 0.5
"""Time after a visitor's last input at the scrubber during which the page leaves it alone [s]."""


class DriveTab:
    """The tab that fits on the screen without scrolling."""

    def __init__(self, gui: Any, tab: Any, playback: Playback | None, requests: VisitorRequests):
        """Add the contents to a tab; without playback no controls."""
        self._requests = requests
        self._times = Trajectory.empty_times()
        self.outdated = True
        """Whether the playback has moved to a time that is not drawn yet."""
        self._held_until: float | None = None
        """When the page may move the scrubber again [s]; None if it may."""
        self._played_while_held = False
        """Whether it was playing, so that the page was moving the scrubber, when it was taken."""
        self._playback = playback
        self.go_to_failure: Action = lambda: None
        """Shows the rover at the failure of the shown path."""
        with tab:
            if playback is not None:
                actions = self._actions(playback)
                self._controls = PlaybackControls(gui, tab, actions, playback.speed)
            self._verdict = gui.add_html("")
            self._failure = FailureButton(gui, lambda: requests.add(self.go_to_failure))
            self._dashboard = gui.add_html("")
            self._details = gui.add_html("", visible=playback is not None)
            self._topics = gui.add_html("", visible=playback is None)

    def _actions(self, playback: Playback) -> PlaybackActions:
        play = (playback.rewind, playback.play, playback.fast_forward)
        step = (
            lambda: playback.step(self._times, -1),
            lambda: playback.step(self._times, 1),
            lambda: playback.go_to(0.0),
        )
        actions = dict(zip((*PLAY_BUTTONS, *STEP_BUTTONS), (*play, *step), strict=True))
        actions[PAUSE_BUTTONS[1]] = playback.pause

        def request(action: Action) -> Action:
            return lambda: self._requests.add(lambda: self._move(action))

        def seek(time: float) -> None:
            self._requests.add(lambda: self._move(lambda: self._scrub(playback, time)), "seek")

        def set_speed(speed: float) -> None:
            playback.speed = speed

        buttons = {name: request(action) for name, action in actions.items()}
        return PlaybackActions(buttons, request(playback.toggle), seek, set_speed)

    def _move(self, action: Action) -> None:
        action()
        self.outdated = True

    def _scrub(self, playback: Playback, to: float) -> None:
        self._held_until = time.monotonic() + SCRUB_HOLD
        self._played_while_held = self._played_while_held or playback.rate != 0.0
        playback.go_to(to)

    def set_trajectory(self, trajectory: Trajectory) -> None:
        """Play another trajectory."""
        self._times = trajectory.times
        if self._playback is not None:
            self._playback.set_drive(trajectory.times, trajectory.distance)
        self.outdated = True

    def show_verdict(self, text: str, details: str = "") -> None:
        """Show a verdict above the board and its details below it, HTML."""
        self._verdict.content, self._details.content = text, details

    def show_failure(self, failure: Failure | None) -> None:
        """Show the failure of the shown path; None if it has none."""
        self._failure.show(failure)
        if self._playback is not None:
            at = None if failure is None else failure.time
            self._controls.mark_failure(at, self._playback.duration)

    def show_topics(self, text: str) -> None:
        """Show the topics of a live rover, HTML."""
        self._topics.content = text

    def show(
        self,
        rover: Rover,
        state: RoverState | None,
        status: str,
        notes: BoardNotes | None = None,
        *,
        stale: bool = False,
    ) -> None:
        """Show a state on the dashboard, and a status; without a state only the status.

        A stale state, which was the rover's some time ago, is grey.
        """
        if self._playback is not None:
            self._controls.show_playing(self._playback.rate != 0.0)
        if state is not None:
            status += f"; at x {state.position[0]:.2f} m, y {state.position[1]:.2f} m"
        if state is None:
            self._dashboard.content = draw_empty_dashboard(status)
        else:
            board = draw_dashboard(rover, state, status, notes)
            if stale:
                board = f'<div style="opacity:.45;filter:grayscale(1)">{board}</div>'
            self._dashboard.content = board

    def move_scrubber(self) -> None:
        """Move the scrubber to the time of the playback, unless a visitor is using it.

        A number that changes while a visitor types it would become another one.
        """
        if self._held_until is None and self._playback is not None:
            self._controls.move_scrubber(self._playback.time, self._playback.duration)

    def release_scrubber(self) -> None:
        """Move the scrubber to the time of the playback once a visitor has stopped using it."""
        playback, held_until = self._playback, self._held_until
        if playback is not None and held_until is not None and time.monotonic() > held_until:
            resend = self._played_while_held
            self._played_while_held, self._held_until = False, None
            self._controls.move_scrubber(playback.time, playback.duration, resend=resend)
