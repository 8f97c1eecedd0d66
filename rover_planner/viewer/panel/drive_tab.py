"""The tab of the drive: playback, verdict and the dashboard of the paper's Figure 5."""

import time
from typing import Any

from rover_physics.rover.model import Rover
from rover_planner.viewer.panel.controls import (
    PLAY_BUTTONS,
    STEP_BUTTONS,
    PlaybackActions,
    PlaybackControls,
)
from rover_planner.viewer.panel.dashboard import draw_dashboard, draw_empty_dashboard
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.trajectory import RoverState, Trajectory
from rover_planner.viewer.state.visitor_requests import Action, VisitorRequests

SCRUB_HOLD = 0.5
"""Time after a visitor's last input at the scrubber during which the page leaves it alone [s]."""


class DriveTab:
    """The tab that fits on the screen without scrolling."""

    def __init__(self, gui: Any, playback: Playback | None, requests: VisitorRequests):
        """Add the tab's contents to the container that is open; without playback no controls."""
        self._requests = requests
        self._times = Trajectory.empty_times()
        self.outdated = True
        """Whether the playback has moved to a time that is not drawn yet."""
        self._held_until: float | None = None
        """When the page may move the scrubber again [s]; None if it may."""
        self._played_while_held = False
        """Whether it was playing, so that the page was moving the scrubber, when it was taken."""
        if playback is not None:
            self._playback = playback
            self._controls = PlaybackControls(gui, self._actions(), playback.speed)
        self._verdict = gui.add_html("")
        self._dashboard = gui.add_html("")

    def _actions(self) -> PlaybackActions:
        playback = self._playback
        play = (playback.rewind, playback.play, playback.pause, playback.fast_forward)
        step = (lambda: self._step(-1), lambda: self._step(1), lambda: self._seek(0.0))
        actions = dict(zip((*PLAY_BUTTONS, *STEP_BUTTONS), (*play, *step), strict=True))

        def request(action: Action) -> Action:
            return lambda: self._requests.add(lambda: self._move(action))

        def seek(time: float) -> None:
            self._requests.add(lambda: self._move(lambda: self._scrub(time)), "seek")

        def set_speed(speed: float) -> None:
            playback.speed = speed

        buttons = {name: request(action) for name, action in actions.items()}
        return PlaybackActions(buttons, seek, set_speed)

    def _move(self, action: Action) -> None:
        action()
        self.outdated = True

    def _step(self, by: int) -> None:
        self._playback.step(self._times, by)

    def _seek(self, time: float) -> None:
        self._playback.pause()
        self._playback.seek(time)

    def _scrub(self, to: float) -> None:
        self._held_until = time.monotonic() + SCRUB_HOLD
        self._played_while_held = self._played_while_held or self._playback.rate != 0.0
        self._seek(to)

    def set_trajectory(self, trajectory: Trajectory) -> None:
        """Play another trajectory."""
        self._times = trajectory.times
        self._playback.set_duration(trajectory.duration)
        self.outdated = True

    def show_verdict(self, text: str) -> None:
        """Show a verdict, HTML."""
        self._verdict.content = text

    def show(self, rover: Rover, state: RoverState | None, status: str) -> None:
        """Show a state on the dashboard, and a status; without a state only the status."""
        if state is None:
            self._dashboard.content = draw_empty_dashboard(status)
        else:
            self._dashboard.content = draw_dashboard(rover, state, status)

    def move_scrubber(self) -> None:
        """Move the scrubber to the time of the playback, unless a visitor is using it.

        A number that changes while a visitor types it would become another one.
        """
        if self._held_until is None:
            self._controls.move_scrubber(self._playback.time, self._playback.duration)

    def release_scrubber(self) -> None:
        """Move the scrubber to the time of the playback once a visitor has stopped using it."""
        if self._held_until is not None and time.monotonic() > self._held_until:
            resend = self._played_while_held
            self._played_while_held, self._held_until = False, None
            self._controls.move_scrubber(
                self._playback.time, self._playback.duration, resend=resend
            )
