"""The tab of the rover: presets, rover files, and a slider for each of its numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover, preset_names
from rover_planner.studies.rover_values import RoverValue, read_rover, write_rover
from rover_planner.viewer.panel.controls import RoverSliders, on_visitor_input

FULL_TURN = 3.15
"""Largest angle, both ways, of the slider of an arm's joint without limits [rad]."""


@dataclass(frozen=True)
class RoverActions:
    """What the controls of the tab do."""

    load: Callable[[Callable[[], Rover]], None]
    """Shows the rover that a function reads."""
    change: Callable[[RoverValue, float], None]
    """Changes a number of the rover."""
    turn_arm: Callable[[str, float], None]
    """Turns a joint of the arm to an angle [rad]."""
    current: Callable[[], Rover]
    """Returns the rover."""


class RoverTab:
    """Verdict, files and sliders; each rover that is loaded gets sliders of its own."""

    def __init__(self, gui: Any, tab: Any, actions: RoverActions):
        """Add the contents to a tab."""
        self._gui, self._tab, self._actions = gui, tab, actions
        with tab:
            self._verdict = gui.add_html("")
            preset = gui.add_dropdown("Preset", preset_names(), initial_value="lsr1")
            preset.on_update(self._load_preset)
            upload = gui.add_upload_button("Load a rover file", mime_type=".yaml,.yml")
            upload.on_upload(self._load_file)
            save = gui.add_button("Save as rover file")
            save.on_click(self._save)
        self._sliders: RoverSliders | None = None
        self._folder: Any = None
        """The folder of the sliders."""
        self._arm: dict[str, Any] = {}

    def _load_preset(self, event: Any) -> None:
        name = event.target.value
        self._actions.load(lambda: load_rover(name))

    def _load_file(self, event: Any) -> None:
        file = event.target.value
        text = file.content.decode("utf-8", "replace")
        self._actions.load(lambda: read_rover(text, file.name))

    def _save(self, event: Any) -> None:
        rover = self._actions.current()
        name = f"{Path(rover.name).stem}.yaml"
        event.client.send_file_download(name, write_rover(rover).encode(), save_immediately=True)

    def set_rover(self, rover: Rover) -> None:
        """Replace the sliders by those of another rover."""
        if self._folder is not None:
            self._folder.remove()
        with self._tab:
            self._folder = self._gui.add_folder(None)
        with self._folder:
            self._sliders = RoverSliders(self._gui, rover, self._actions.change)
            self._arm = {}
            if rover.manipulator is not None:
                with self._gui.add_folder("Arm", expand_by_default=False):
                    self._add_arm(rover.manipulator)

    def _add_arm(self, arm: Any) -> None:
        limits = arm.joint_limits or ((-FULL_TURN, FULL_TURN),) * 3
        for joint, (low, high), stowed in zip(arm.joints, limits, arm.stowed, strict=True):
            slider = self._gui.add_slider(f"{joint} [rad]", low, high, 0.01, stowed)
            on_visitor_input(slider, partial(self._actions.turn_arm, joint))
            self._arm[joint] = slider

    def show_verdict(self, text: str) -> None:
        """Show a verdict, HTML."""
        self._verdict.content = text

    def show_values(self, rover: Rover) -> None:
        """Move the sliders to the values of the rover, after one was refused."""
        if self._sliders is not None:
            self._sliders.show(rover)
