"""The buttons and sliders of the page; each calls back, none decides."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rover_physics.rover import Rover
from rover_planner.viewer.playback import SPEEDS
from rover_planner.viewer.rover_values import RoverValue, get_value, list_values, rover_to_dict

NO_SOIL = "none (Coulomb)"


@dataclass(frozen=True)
class PlayerActions:
    """What the player's buttons do."""

    play: Callable[[], None]
    """Play from here."""
    pause: Callable[[], None]
    """Stop here."""
    rewind: Callable[[], None]
    """Play backwards, faster."""
    fast_forward: Callable[[], None]
    """Play faster."""
    step_back: Callable[[], None]
    """Go to the waypoint before."""
    step: Callable[[], None]
    """Go to the next waypoint."""
    seek: Callable[[float], None]
    """Go to a time in percent of the journey."""
    set_speed: Callable[[float], None]
    """Choose a speed."""


class Player:
    """Play, pause, step, rewind, fast forward, speed and a scrubber."""

    def __init__(self, gui: Any, actions: PlayerActions, speed: float):
        names = ("Rewind", "Back", "Play", "Pause", "Step", "Fast forward")
        self._buttons = gui.add_button_group("", names)
        calls = {
            "Rewind": actions.rewind,
            "Back": actions.step_back,
            "Play": actions.play,
            "Pause": actions.pause,
            "Step": actions.step,
            "Fast forward": actions.fast_forward,
        }
        self._buttons.on_click(lambda event: calls[event.target.value]())
        self._scrubber = gui.add_slider("Time [%]", 0.0, 100.0, 0.1, 0.0)
        self._scrubber.on_update(
            lambda event: actions.seek(event.target.value) if event.client else None
        )
        self._speed = gui.add_dropdown(
            "Speed", [f"{s} x" for s in SPEEDS], initial_value=f"{speed:g} x"
        )
        self._speed.on_update(
            lambda event: actions.set_speed(float(event.target.value.removesuffix(" x")))
        )

    def show(self, percent: float) -> None:
        """Move the scrubber."""
        self._scrubber.value = round(percent, 1)


class RoverSliders:
    """A slider with its unit for each value of the rover that can be changed."""

    def __init__(self, gui: Any, rover: Rover, change: Callable[[RoverValue, float], None]):
        """Add a folder for each part of the rover to the container that is open."""
        self._sliders: dict[str, Any] = {}
        self._values = list_values(rover)
        data = rover_to_dict(rover)
        self.folders = []
        for part, values in self._values.items():
            folder = gui.add_folder(part, expand_by_default=part in ("Links", "Drive"))
            self.folders.append(folder)
            with folder:
                for value in values:
                    self._add(gui, value, get_value(data, value.keys[0]), change)

    def _add(
        self, gui: Any, value: RoverValue, now: float, change: Callable[[RoverValue, float], None]
    ) -> None:
        low, high = min(value.low, now), max(value.high, now)
        slider = gui.add_slider(value.label, low, high, value.step, now)
        slider.on_update(
            lambda event: change(value, float(event.target.value)) if event.client else None
        )
        self._sliders[value.label] = slider

    def show(self, rover: Rover) -> None:
        """Show the values of a rover, after one was refused."""
        data = rover_to_dict(rover)
        for values in self._values.values():
            for value in values:
                self._sliders[value.label].value = get_value(data, value.keys[0])
