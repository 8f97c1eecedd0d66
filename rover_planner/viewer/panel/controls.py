# SPDX-License-Identifier: Apache-2.0
"""The buttons and sliders of the page; they only pass on what a visitor does."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_planner.studies.rover_values import RoverValue, get_value, list_values
from rover_planner.viewer.state.playback import SPEEDS
from rover_planner.viewer.state.visitor_requests import Action


@dataclass(frozen=True)
class PlaybackActions:
    """What the controls of the playback do."""

    buttons: dict[str, Action]
    """By the name of the button, of PLAY_BUTTONS, PAUSE_BUTTONS and STEP_BUTTONS."""
    toggle: Action
    """Plays if it is paused, else pauses."""
    seek: Callable[[float], None]
    """Goes to a time [s]."""
    set_speed: Callable[[float], None]
    """Chooses a speed."""


PLAY_BUTTONS = ("Rewind", "Play", "Fast forward")
"""While it is paused."""
PAUSE_BUTTONS = ("Rewind", "Pause", "Fast forward")
"""While it plays."""
FAILS = "fails"
"""Word below the mark of a failure on the scrubber."""
CHANGED = "\u25cf "
"""What stands before the label of a number that differs from that of the loaded rover."""
STEP_BUTTONS = ("Step back", "Step", "To the start")
KEYS = {"Step back": "arrowleft", "Step": "arrowright", "To the start": "home"}
"""Keys of buttons; the space bar plays and pauses."""


def on_visitor_input(control: Any, action: Callable[[Any], None]) -> None:
    """Call a quick action with each value that a visitor gives a control.

    The value is read at once, on the loop that received it. Callbacks are otherwise called in a
    thread of their own, before which the page may have set another value.
    """

    async def read(event: Any) -> None:
        if event.client is not None:
            action(event.target.value)

    control.on_update(read)


class PlaybackControls:
    """Play, pause, step, rewind, fast forward, speed and a scrubber."""

    def __init__(self, gui: Any, tab: Any, actions: PlaybackActions, speed: float):
        """Add the controls to a tab."""
        self._gui, self._tab, self._seek = gui, tab, actions.seek
        self._failure_at: float | None = None
        self._play = gui.add_button_group("Playback", PLAY_BUTTONS)
        steps = gui.add_button_group("Waypoint", STEP_BUTTONS)

        async def press(event: Any) -> None:
            actions.buttons[event.target.value]()

        for group in (self._play, steps):
            group.on_click(press)
        keys = {name: (key, actions.buttons[name]) for name, key in KEYS.items()}
        for label, (key, action) in ({"Play or pause": ("space", actions.toggle)} | keys).items():
            command = gui.add_command(label, hotkey=key)
            command.on_trigger(lambda _event, action=action: action())
        self._scrubber = gui.add_slider("Time [s]", 0.0, 1.0, 0.1, 0.0)
        on_visitor_input(self._scrubber, self._seek)
        speeds = [f"{s} x" for s in SPEEDS]
        self._speed = gui.add_dropdown("Speed", speeds, initial_value=f"{speed:g} x")
        self._speed.on_update(
            lambda event: actions.set_speed(float(event.target.value.removesuffix(" x")))
        )

    def show_playing(self, playing: bool) -> None:
        """Name the button in the middle by what it does next."""
        names = PAUSE_BUTTONS if playing else PLAY_BUTTONS
        if self._play.options != names:
            self._play.options = names

    def mark_failure(self, time: float | None, duration: float) -> None:
        """Mark the time of a failure [s] on the scrubber of a drive of a duration; None: no mark.

        Marks cannot be changed, so that another slider takes its place.
        """
        if time == self._failure_at:
            return
        self._failure_at = time
        end, old = _end_of(duration), self._scrubber
        marks = None if time is None else ((min(time, end), FAILS),)
        with self._tab:
            self._scrubber = self._gui.add_slider(
                old.label, 0.0, end, 0.1, min(old.value, end), marks=marks, order=old.order
            )
        on_visitor_input(self._scrubber, self._seek)
        old.remove()

    def move_scrubber(self, time: float, duration: float, *, resend: bool = False) -> None:
        """Move the scrubber to a time of a drive [s].

        Args:
            time: The time.
            duration: Duration of the drive.
            resend: Whether to send the time even if the scrubber has it already.
        """
        if resend:
            # Another time may have been on its way to the browser when the visitor chose this one,
            # and a value is sent only where it changes.
            self._scrubber.value = self._scrubber.min
        end = _end_of(duration)
        if end < self._scrubber.max:
            self._scrubber.value = min(round(time, 1), end)
            self._scrubber.max = end
        else:
            self._scrubber.max = end
            self._scrubber.value = min(round(time, 1), end)


def _end_of(duration: float) -> float:
    """Return the last time on the scrubber of a drive of a duration [s]."""
    return max(round(duration, 1), 0.1)


class RoverSliders:
    """A slider for each number of the rover that can be changed."""

    def __init__(self, gui: Any, rover: Rover, change: Callable[[RoverValue, float], None]):
        """Add a folder for each part of the rover to the container that is open."""
        self._sliders: dict[RoverValue, Any] = {}
        data = rover_to_dict(rover)
        for part, values in list_values(rover).items():
            with gui.add_folder(part, expand_by_default=part in ("Ground and drive", "Links")):
                for value in values:
                    self._add(gui, value, get_value(data, value.keys[0]), change)

    def _add(
        self, gui: Any, value: RoverValue, now: float, change: Callable[[RoverValue, float], None]
    ) -> None:
        slider = gui.add_slider(value.label, value.low, value.high, value.step, now)
        on_visitor_input(slider, lambda number: change(value, float(number)))
        self._sliders[value] = slider

    def show(self, rover: Rover) -> None:
        """Move the sliders to the values of a rover."""
        data = rover_to_dict(rover)
        for value, slider in self._sliders.items():
            now = get_value(data, value.keys[0])
            if abs(slider.value - now) > 1e-9:
                slider.value = now

    def mark(self, changed: Collection[str]) -> None:
        """Mark the sliders of changed numbers by their labels."""
        for value, slider in self._sliders.items():
            label = f"{CHANGED}{value.label}" if value.label in changed else value.label
            if slider.label != label:
                slider.label = label
