# SPDX-License-Identifier: Apache-2.0
"""The tab of the rover: presets, rover files, and a slider for each of its numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rover_physics.rover.model import Manipulator, Rover
from rover_physics.rover.rover_file import load_rover, preset_names, rover_to_dict
from rover_planner.studies.rover_values import (
    RoverValue,
    get_value,
    list_values,
    read_rover,
    write_rover,
)
from rover_planner.viewer.panel.changes import draw_changes
from rover_planner.viewer.panel.controls import on_slider_input
from rover_planner.viewer.state.before_after import Difference
from rover_planner.viewer.state.visitor_requests import Action

FULL_TURN = 3.15
"""Largest angle, both ways, of the slider of an arm's joint without limits [rad]."""
VERDICT_HEIGHT = 104
"""Height of the verdict [px], so that no slider moves under the mouse. A longer one scrolls."""
OPEN_FOLDERS = ("Ground and drive", "Links")
"""Folders of sliders that are open at first."""
CHANGED = "\u25cf "
"""Prefix of the label of a number that differs from that of the loaded rover."""


@dataclass(frozen=True)
class RoverActions:
    """Actions of the controls of the tab."""

    load: Callable[[Callable[[], Rover]], None]
    """Shows the rover that a function reads."""
    change: Callable[[RoverValue, float], None]
    """Changes a number of the rover."""
    turn_arm: Callable[[str, float], None]
    """Turns a joint of the arm to an angle [rad]."""
    current: Callable[[], Rover]
    """Returns the rover."""
    undo: Action
    """Takes the last rover again."""
    reset: Action
    """Takes the rover as it was loaded."""


class RoverTab:
    """Verdict, files and sliders; each rover that is loaded gets sliders of its own."""

    def __init__(self, gui: Any, tab: Any, actions: RoverActions):
        """Add the contents to a tab."""
        self._gui, self._tab, self._actions = gui, tab, actions
        buttons = {"Undo": actions.undo, "Reset": actions.reset}
        with tab:
            self._verdict = gui.add_html("")
            group = gui.add_button_group("Rover", tuple(buttons))
            group.on_click(lambda event: buttons[event.target.value]())
            self._changes = gui.add_html(draw_changes({}, ()))
            self._preset = gui.add_dropdown("Preset", preset_names())
            self._preset.on_update(self._load_preset)
            upload = gui.add_upload_button("Load a rover file", mime_type=".yaml,.yml")
            upload.on_upload(self._load_file)
            gui.add_button("Save as rover file").on_click(self._save)
        self._loaded: Rover | None = None
        self._folder: Any = None
        """The folder of the sliders."""
        self.sliders: dict[RoverValue, Any] = {}
        """The sliders of the rover's numbers."""
        self.arm: dict[str, Any] = {}
        """Those of the arm's joints by name."""

    def _load_preset(self, event: Any) -> None:
        name = event.target.value
        if event.client is not None and name in preset_names():
            self._actions.load(lambda: load_rover(name))

    def _load_file(self, event: Any) -> None:
        file = event.target.value
        text = file.content.decode("utf-8", "replace")
        self._actions.load(lambda: read_rover(text, file.name))

    def _save(self, event: Any) -> None:
        rover = self._actions.current()
        name = f"{Path(rover.name).stem}.yaml"
        event.client.send_file_download(name, write_rover(rover).encode(), save_immediately=True)

    def show_rover(self, loaded: Rover, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Show a rover that was loaded, and its values, as after one was refused.

        Args:
            loaded: The rover as it was loaded; another one gets other sliders.
            rover: The same with its numbers as they were changed since.
            arm_angles: Angles [rad] of the arm's joints by name; others are stowed.
        """
        if self._loaded is not loaded:
            self._loaded = loaded
            self._add_sliders(loaded)
        data = rover_to_dict(rover)
        for value, slider in self.sliders.items():
            now = get_value(data, value.keys[0])
            if abs(slider.value - now) > 1e-9:
                slider.value = now
        if rover.manipulator is not None:
            stowed = dict(zip(rover.manipulator.joints, rover.manipulator.stowed, strict=True))
            for joint, slider in self.arm.items():
                slider.value = arm_angles.get(joint, stowed[joint])

    def _add_sliders(self, rover: Rover) -> None:
        """Replace the sliders by those of another rover, and name it in the box of presets."""
        name = rover.name
        if name not in preset_names() or load_rover(name) != rover:
            name = f"{name} (file)"
        self._preset.options = tuple(dict.fromkeys((*preset_names(), name)))
        self._preset.value = name
        if self._folder is not None:
            self._folder.remove()
        self.sliders, self.arm, data = {}, {}, rover_to_dict(rover)
        with self._tab:
            self._folder = self._gui.add_folder(None)
        with self._folder:
            for part, values in list_values(rover).items():
                with self._gui.add_folder(part, expand_by_default=part in OPEN_FOLDERS):
                    for value in values:
                        now = get_value(data, value.keys[0])
                        self.sliders[value] = self._add_slider(
                            (value.label, value.low, value.high, value.step, now),
                            partial(self._actions.change, value),
                        )
            if rover.manipulator is not None:
                with self._gui.add_folder("Arm", expand_by_default=False):
                    self._add_arm(rover.manipulator)

    def _add_arm(self, arm: Manipulator) -> None:
        limits = arm.joint_limits or ((-FULL_TURN, FULL_TURN),) * 3
        for joint, (low, high), stowed in zip(arm.joints, limits, arm.stowed, strict=True):
            self.arm[joint] = self._add_slider(
                (f"{joint} [rad]", low, high, 0.01, stowed), partial(self._actions.turn_arm, joint)
            )

    def _add_slider(
        self, settings: tuple[str, float, float, float, float], act: Callable[[float], None]
    ) -> Any:
        """Add a slider by its label, ends, step and value, and what a visitor's number does."""
        slider = self._gui.add_slider(*settings)
        on_slider_input(slider, act)
        return slider

    def show_verdict(self, text: str) -> None:
        """Show a verdict, HTML."""
        style = f"height:{VERDICT_HEIGHT}px;overflow-y:auto"
        self._verdict.content = f'<div style="{style}">{text}</div>'

    def show_changes(
        self, changed: Mapping[str, tuple[float, float]], differences: Sequence[Difference]
    ) -> None:
        """Show changed numbers by label, mark their sliders, and show what that has changed."""
        self._changes.content = draw_changes(changed, differences)
        for value, slider in self.sliders.items():
            label = f"{CHANGED}{value.label}" if value.label in changed else value.label
            if slider.label != label:
                slider.label = label
