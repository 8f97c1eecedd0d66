# SPDX-License-Identifier: Apache-2.0
"""The tab of the drive: playback, verdict and the dashboard of the paper's Figure 5."""

import time
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.viewer.panel.board import BoardNotes
from rover_planner.viewer.panel.controls import on_slider_input
from rover_planner.viewer.panel.dashboard import draw_dashboard, draw_empty_dashboard
from rover_planner.viewer.state.failure import Failure
from rover_planner.viewer.state.playback import SPEEDS, Playback
from rover_planner.viewer.state.trajectory import RoverState, Trajectory
from rover_planner.viewer.state.visitor_requests import Action, VisitorRequests

PLAY, PAUSE = "Play", "Pause"
"""Names of the button in the middle while it is paused, and while it plays."""
FAILS = "fails"
"""Word below the mark of a failure on the scrubber."""
SCRUB_HOLD = 0.5
"""Time after a visitor's last input at the scrubber during which the page leaves it alone [s]."""


class PlaybackControls:
    """Rewind, play, pause, steps, a scrubber and the speed."""

    def __init__(self, gui: Any, tab: Any, playback: Playback, requests: VisitorRequests):
        """Add the controls to the open tab `tab`."""
        self._gui, self._tab, self._playback, self._requests = gui, tab, playback, requests
        self.outdated = True
        """True if the playback has moved to a time that is not drawn yet."""
        self._times = np.zeros(1)
        self._failure_at: float | None = None
        self._held_until: float | None = None
        """When the page may move the scrubber again [s]; None if it may."""
        steps = {
            "Step back": lambda: playback.step(self._times, -1),
            "Step": lambda: playback.step(self._times, 1),
            "To the start": lambda: playback.go_to(0.0),
        }
        plays = {"Rewind": playback.rewind, PLAY: playback.play, PAUSE: playback.pause}
        self._play = gui.add_button_group("Playback", ("Rewind", PLAY))
        self._act_on(self._play, plays)
        self._act_on(gui.add_button_group("Waypoint", tuple(steps)), steps)
        hotkeys = zip(("arrowleft", "arrowright", "home"), steps.items(), strict=True)
        commands = [("space", ("Play or pause", playback.toggle)), *hotkeys]
        for key, (label, action) in commands:
            command = gui.add_command(label, hotkey=key)
            command.on_trigger(lambda _event, action=action: self._request(action))
        self._add_scrubber(1.0, 0.0, None)
        speed = gui.add_dropdown(
            "Speed", [f"{s} x" for s in SPEEDS], initial_value=f"{playback.speed:g} x"
        )
        speed.on_update(lambda event: self._set_speed(event.target.value))

    def _act_on(self, group: Any, actions: dict[str, Action]) -> None:
        async def press(event: Any) -> None:
            self._request(actions[event.target.value])

        group.on_click(press)

    def _request(self, action: Action, kind: str = "") -> None:
        """Request a move of the playback, and the next picture."""

        def move() -> None:
            action()
            self.outdated = True

        self._requests.add(move, kind)

    def _set_speed(self, text: str) -> None:
        self._playback.speed = float(text.removesuffix(" x"))

    def _add_scrubber(self, end: float, value: float, order: float | None) -> None:
        marks = None if self._failure_at is None else ((min(self._failure_at, end), FAILS),)
        self._scrubber = self._gui.add_slider(
            "Time [s]", 0.0, end, 0.1, value, marks=marks, order=order
        )
        on_slider_input(self._scrubber, lambda to: self._request(lambda: self._scrub(to), "seek"))

    def _scrub(self, to: float) -> None:
        self._held_until = time.monotonic() + SCRUB_HOLD
        self._playback.go_to(to)

    def set_drive(self, trajectory: Trajectory) -> None:
        """Play another trajectory."""
        self._times, self.outdated = trajectory.times, True
        self._playback.set_drive(trajectory.times, trajectory.distance)

    def mark_failure(self, at: float | None) -> None:
        """Mark the time of a failure [s] on the scrubber; None: no mark.

        Marks cannot be changed, so that another slider takes its place.
        """
        if at == self._failure_at:
            return
        self._failure_at, old, end = at, self._scrubber, self._end
        with self._tab:
            self._add_scrubber(end, min(old.value, end), old.order)
        old.remove()

    def show_playing(self) -> None:
        """Name the button in the middle by what it does next."""
        names = ("Rewind", PLAY if self._playback.rate == 0.0 else PAUSE)
        if self._play.options != names:
            self._play.options = names

    @property
    def _end(self) -> float:
        """The last time on the scrubber [s]."""
        return max(round(self._playback.duration, 1), 0.1)

    def move_scrubber(self) -> None:
        """Move the scrubber to the time of the playback, unless a visitor is using it.

        A number that changes while a visitor types it would become another one.
        """
        if self._held_until is None:
            end, scrubber = self._end, self._scrubber
            at = min(round(self._playback.time, 1), end)
            if end < scrubber.max:  # its value must never be beyond its end
                scrubber.value, scrubber.max = at, end
            else:
                scrubber.max, scrubber.value = end, at

    def release_scrubber(self) -> None:
        """Move the scrubber to the time of the playback once a visitor has stopped using it.

        Another time may have been on its way to the browser when the visitor chose this one, and
        a value is sent only where it changes: so another one is sent before.
        """
        if self._held_until is not None and time.monotonic() > self._held_until:
            self._held_until = None
            self._scrubber.value = self._scrubber.min
            self.move_scrubber()


class DriveTab:
    """The tab that fits on the screen without scrolling."""

    def __init__(self, gui: Any, tab: Any, requests: VisitorRequests, playback: Playback | None):
        """Add the contents to a tab; without playback no controls."""
        self.go_to_failure: Action = lambda: None
        """Shows the rover at the failure of the shown path."""
        self.controls: PlaybackControls | None = None
        with tab:
            if playback is not None:
                self.controls = PlaybackControls(gui, tab, playback, requests)
            self._verdict = gui.add_html("")
            self._failure = gui.add_button("Go to the failure", visible=False)
            self._failure.on_click(lambda _event: requests.add(self.go_to_failure))
            self._dashboard, self._below = gui.add_html(""), gui.add_html("")

    def show_verdict(self, text: str) -> None:
        """Show a verdict above the board, HTML."""
        self._verdict.content = text

    def show_below(self, text: str) -> None:
        """Show details of the verdict, or the topics of a live rover, below the board, HTML."""
        self._below.content = text

    def show_failure(self, failure: Failure | None) -> None:
        """Show the button and the mark of the shown path's failure; None if it has none."""
        self._failure.visible = failure is not None
        if self.controls is not None:
            self.controls.mark_failure(None if failure is None else failure.time)

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
        if self.controls is not None:
            self.controls.show_playing()
        if state is None:
            self._dashboard.content = draw_empty_dashboard(status)
            return
        status += f"; at x {state.position[0]:.2f} m, y {state.position[1]:.2f} m"
        board = draw_dashboard(rover, state, status, notes)
        grey = "opacity:.45;filter:grayscale(1)" if stale else ""
        self._dashboard.content = f'<div style="{grey}">{board}</div>'
