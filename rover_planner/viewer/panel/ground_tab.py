# SPDX-License-Identifier: Apache-2.0
"""The tab of ground and path: what a click sets, torques, soil, and the ground's colours."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rover_physics.terrain.soil_file import load_soils
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.viewer.panel.controls import on_visitor_input
from rover_planner.viewer.panel.legend import draw_scale
from rover_planner.viewer.state.colours import ColourScale
from rover_planner.viewer.state.layers import HEIGHT, LAYERS
from rover_planner.viewer.state.visitor_requests import Action

NO_SOIL = "none (Coulomb)"
POLICIES = {
    "equal on all wheels": "equal",
    "speed servos": "servo",
    "traction control": "optimal",
}


@dataclass(frozen=True)
class GroundActions:
    """Actions of the controls of the tab."""

    recolour: Action
    """Colours the ground again."""
    show_forces: Callable[[bool], None]
    """Shows or hides the arrows."""
    set_options: Callable[..., None] = lambda **_changes: None
    """Changes fields of PathQueryOptions."""
    show_between: Callable[[bool], None] = lambda _visible: None
    """Shows or hides the poses between the waypoints before a failure."""


class GroundTab:
    """Drop-downs and boxes, and the scale of the colours."""

    def __init__(
        self,
        gui: Any,
        actions: GroundActions,
        *,
        has_paths: bool = True,
        surveyed: tuple[str, ...] = (),
    ):
        """Add the tab's contents to the container that is open.

        Args:
            gui: The GUI of viser.
            actions: What the controls do.
            has_paths: Whether the page plans paths, so that there are controls for them.
            surveyed: Layers of a survey, the first of which colours the ground at first.
        """
        self._gui, self._surveyed, self._has_paths = gui, surveyed, has_paths
        if has_paths:
            self._add_path_controls(actions)
        self._layer = gui.add_dropdown(
            "Colour by", self.layers, initial_value=(*surveyed, HEIGHT)[0]
        )
        self._heading = gui.add_slider("Heading [deg]", -180, 180, 5, 0)
        self._along = gui.add_checkbox("Heading along the path", False, visible=has_paths)
        self._layer.on_update(lambda _event: self._show_heading())
        for control in (self._layer, self._heading, self._along):
            control.on_update(lambda event: actions.recolour() if event.client else None)
        self._show_heading()
        self._scale = gui.add_html("")
        forces = gui.add_checkbox("Forces", True)
        forces.on_update(lambda event: actions.show_forces(event.target.value))

    def _add_path_controls(self, actions: GroundActions) -> None:
        gui = self._gui
        self._clicks = gui.add_dropdown("A click sets", ("goal", "start"), initial_value="goal")
        self._policy = gui.add_dropdown("Torques", tuple(POLICIES))
        on_visitor_input(self._policy, lambda title: actions.set_options(policy=POLICIES[title]))
        self._soil = gui.add_dropdown("Soil", (NO_SOIL, *load_soils()))
        on_visitor_input(
            self._soil,
            lambda name: actions.set_options(soil=None if name == NO_SOIL else name),
        )
        between = gui.add_checkbox("Poses between waypoints", True)
        between.on_update(lambda event: actions.show_between(event.target.value))

    def _show_heading(self) -> None:
        """Show the controls of the heading while the layer depends on it."""
        self._heading.visible = self.is_predicted
        self._along.visible = self.is_predicted and self._has_paths

    def show_options(self, options: PathQueryOptions) -> None:
        """Choose policy and soil as they are judged."""
        titles = {policy: title for title, policy in POLICIES.items()}
        self._policy.value = titles[options.model.policy]
        self._soil.value = options.model.soil or NO_SOIL

    def choose_layer(self, layer: str, heading: float, *, along: bool = False) -> None:
        """Choose the layer that colours the ground.

        Args:
            layer: Its name.
            heading: Heading of the rover for predicted layers [deg].
            along: Whether they are for the heading of the shown path instead.
        """
        self._layer.value, self._heading.value, self._along.value = layer, heading, along
        self._show_heading()

    @property
    def click_sets(self) -> str:
        """The end of the path that a click sets, "goal" or "start"."""
        return str(self._clicks.value)

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers to choose from."""
        return (*self._surveyed, *LAYERS)

    @property
    def layer(self) -> str:
        """Name of the layer that colours the ground."""
        return str(self._layer.value)

    @property
    def is_predicted(self) -> bool:
        """True if the layer is predicted for the rover."""
        return not self.is_surveyed and LAYERS[self.layer].is_predicted

    @property
    def is_surveyed(self) -> bool:
        """True if the layer is one of a survey."""
        return self.layer in self._surveyed

    @property
    def heading(self) -> float:
        """Heading of the rover for predicted layers [deg]."""
        return float(self._heading.value)

    @property
    def is_along_path(self) -> bool:
        """True if predicted layers are for the heading of the shown path."""
        return bool(self._along.value)

    def show_legend(self, legend: str) -> None:
        """Show what the colours of the ground mean, as HTML."""
        self._scale.content = legend

    def show_scale(self, scale: ColourScale) -> None:
        """Show what the colours of the ground mean."""
        at = "along the path" if self.is_along_path else f"at heading {self.heading:g} deg"
        name = f"{self.layer} {at}" if self.is_predicted else self.layer
        self._scale.content = draw_scale(name, scale)
