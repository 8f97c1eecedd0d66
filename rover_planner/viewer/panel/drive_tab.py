"""The main part of the panel: player, verdict and the board of the paper's Figure 5."""

import time
from typing import Any

from rover_physics.rover.model import Rover
from rover_planner.viewer.panel.board import draw_board, say_nothing_to_show
from rover_planner.viewer.panel.controls import PLAY_BUTTONS, STEP_BUTTONS, Player, PlayerActions
from rover_planner.viewer.state.journey import Frame, Journey
from rover_planner.viewer.state.playback import Playback
from rover_planner.viewer.state.visitor_requests import VisitorRequests

HAND_OFF = 0.5
"""Time after a visitor's last word to the scrubber from which the page moves it again [s]."""


class DriveTab:
    """Everything that has to be on the screen without scrolling."""

    def __init__(self, gui: Any, playback: Playback | None, wishes: VisitorRequests):
        """Add it to the container that is open; no player without a playback."""
        self._wishes = wishes
        self._times = Journey.empty_times()
        self.moved = True
        """Whether a button moved the playback since it was shown."""
        self._hand_on_until: float | None = None
        self._crossed = False
        """Whether the page moved the scrubber when a visitor took it."""
        if playback is not None:
            self._playback = playback
            self._player = Player(gui, self._actions(), playback.speed)
        self._verdict = gui.add_html("")
        self._board = gui.add_html("")

    def _actions(self) -> PlayerActions:
        playback = self._playback
        calls = (playback.rewind, playback.play, playback.pause, playback.fast_forward)
        steps = (lambda: self._step(-1), lambda: self._step(1), lambda: self._seek(0.0))
        acts = dict(zip((*PLAY_BUTTONS, *STEP_BUTTONS), (*calls, *steps), strict=True))

        def ask(act: Any) -> Any:
            return lambda: self._wishes.ask(lambda: self._move(act))

        def seek(place: float) -> None:
            self._wishes.ask(lambda: self._move(lambda: self._scrub(place)), "seek")

        def set_speed(speed: float) -> None:
            playback.speed = speed

        return PlayerActions({name: ask(act) for name, act in acts.items()}, seek, set_speed)

    def _move(self, act: Any) -> None:
        act()
        self.moved = True

    def _step(self, by: int) -> None:
        self._playback.step(self._times, by)

    def _seek(self, place: float) -> None:
        self._playback.pause()
        self._playback.jump(place)

    def _scrub(self, place: float) -> None:
        self._hand_on_until = time.monotonic() + HAND_OFF
        self._crossed = self._crossed or self._playback.rate != 0.0
        self._seek(place)

    def take(self, journey: Journey) -> None:
        """Play another journey."""
        self._times = journey.times
        self._playback.restart(journey.duration)
        self.moved = True

    def show_verdict(self, text: str) -> None:
        """Show a verdict as HTML."""
        self._verdict.content = text

    def show(self, rover: Rover, frame: Frame | None, state: str) -> None:
        """Show a frame and how it is come by; None where the rover stands nowhere."""
        if frame is None:
            self._board.content = say_nothing_to_show(state)
            return
        self._board.content = draw_board(rover, frame, state)

    def show_time(self) -> None:
        """Move the scrubber to where the playback is, unless a visitor has a hand on it.

        A number that is written over while it is typed becomes another one.
        """
        if self._hand_on_until is None:
            self._player.show(self._playback.time, self._playback.duration)

    def settle_scrubber(self) -> None:
        """Move the scrubber to where the playback is once a visitor has let go of it."""
        if self._hand_on_until is not None and time.monotonic() > self._hand_on_until:
            crossed, self._crossed, self._hand_on_until = self._crossed, False, None
            self._player.show(self._playback.time, self._playback.duration, anew=crossed)
