"""The tab of ground and path: what a click sets, the path that is shown, the ground's colours."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rover_physics.terrain.soil_file import load_soils
from rover_planner.planning.path_query import PathAnswer
from rover_planner.viewer.state.colours import ColourScale
from rover_planner.viewer.state.layers import HEIGHT, LAYERS
from rover_planner.viewer.state.visitor_requests import Action

NO_SOIL = "none (Coulomb)"
BEST = "best"
POLICIES = {
    "equal on all wheels": "equal",
    "speed servos": "servo",
    "traction control": "optimal",
}


@dataclass(frozen=True)
class GroundActions:
    """What the controls of the tab do."""

    recolour: Action
    """Colours the ground again."""
    show_forces: Callable[[bool], None]
    """Shows or hides the arrows."""
    follow: Callable[[bool], None]
    """Whether the cameras move with the rover."""
    choose_path: Callable[[int | None], None] = lambda _index: None
    """Shows a candidate by its index; for None the best."""
    set_options: Callable[..., None] = lambda **_changes: None
    """Changes fields of PathQueryOptions."""
    show_asked: Callable[[bool], None] = lambda _visible: None
    """Shows or hides where a search for a way has asked the model."""


class GroundTab:
    """Drop-downs and boxes, and the scale of the colours."""

    def __init__(self, gui: Any, actions: GroundActions, *, has_paths: bool = True):
        """Add the tab's contents to the container that is open.

        Args:
            gui: The GUI of viser.
            actions: What the controls do.
            has_paths: Whether the page plans paths, so that there are controls for them.
        """
        self._gui = gui
        if has_paths:
            self._add_path_controls(actions)
        self._layer = gui.add_dropdown("Colour by", tuple(LAYERS), initial_value=HEIGHT)
        self._heading = gui.add_slider("Heading [deg]", -180, 180, 5, 0)
        for control in (self._layer, self._heading):
            control.on_update(lambda event: actions.recolour() if event.client else None)
        self._scale = gui.add_html("")
        forces = gui.add_checkbox("Forces", True)
        forces.on_update(lambda event: actions.show_forces(event.target.value))
        follow = gui.add_checkbox("Follow rover", False)
        follow.on_update(lambda event: actions.follow(event.target.value))

    def _add_path_controls(self, actions: GroundActions) -> None:
        gui = self._gui
        self._clicks = gui.add_dropdown("A click sets", ("goal", "start"), initial_value="goal")
        self._choice = gui.add_dropdown("Path shown", (BEST,))
        self._choice.on_update(
            lambda event: self._choose(event, actions) if event.client else None
        )
        policy = gui.add_dropdown("Torques", tuple(POLICIES))
        policy.on_update(lambda event: actions.set_options(policy=POLICIES[event.target.value]))
        soil = gui.add_dropdown("Soil", (NO_SOIL, *load_soils()))
        soil.on_update(
            lambda event: actions.set_options(
                soil=None if event.target.value == NO_SOIL else event.target.value
            )
        )
        asked = gui.add_checkbox("What was searched", False)
        asked.on_update(lambda event: actions.show_asked(event.target.value))

    def _choose(self, event: Any, actions: GroundActions) -> None:
        word = event.target.value.split(":")[0]
        actions.choose_path(None if word == BEST else int(word) - 1)

    @property
    def click_sets(self) -> str:
        """What a click sets, "goal" or "start"."""
        return str(self._clicks.value)

    @property
    def layer(self) -> str:
        """Name of the layer that colours the ground."""
        return str(self._layer.value)

    @property
    def is_predicted(self) -> bool:
        """Whether the layer is predicted for the rover."""
        return LAYERS[self.layer].score is not None

    @property
    def heading(self) -> float:
        """Heading of the rover for predicted layers [deg]."""
        return float(self._heading.value)

    def list_paths(self, answer: PathAnswer, shown: int) -> None:
        """List the paths to choose from, and choose the shown one by its index."""
        names = [BEST]
        for k, candidate in enumerate(answer.candidates):
            word = "passable" if candidate.verdict.traversable else "refused"
            names.append(f"{k + 1}: {word}, {candidate.length:.2f} m")
        self._choice.options = tuple(names)
        self._choice.value = BEST if shown == answer.nearest else names[shown + 1]

    def show_scale(self, scale: ColourScale) -> None:
        """Show what the colours of the ground mean."""
        name = f"{self.layer}" + (f" at heading {self.heading:g} deg" if self.is_predicted else "")
        self._scale.content = (
            '<div id="scale" style="font-size:12px;padding:4px 8px">'
            f"<div>{name}</div>"
            '<div style="height:10px;background:linear-gradient(90deg,#00224e,#434e6c,#7d7c78,'
            '#bcae6c,#fee838)"></div>'
            '<div style="display:flex;justify-content:space-between">'
            f"<span>{scale.low:.2f} {scale.unit}</span>"
            f"<span>{scale.high:.2f} {scale.unit}</span></div>"
            '<div style="opacity:.7">grey: unknown, or the rover cannot stand; a line every '
            "metre</div></div>"
        )
