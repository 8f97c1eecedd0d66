# SPDX-License-Identifier: Apache-2.0
"""The place of a failure in the scene: a ghost of the rover, the link that fails, the forces."""

from typing import Any

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.force_arrows import ForceArrows
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.nodes import Nodes, Strand
from rover_planner.viewer.scene.rover_visual import RoverVisual, look_alike
from rover_planner.viewer.state.colours import CASING
from rover_planner.viewer.state.failure import Failure
from rover_planner.viewer.state.rover_state import RoverState

NAME, REASON = "/failure", "/reason"
OPACITY = 0.55
"""Opacity of the ghost."""
NEAR = 0.5
"""Distance of the played rover at which the ghost makes room for it [wheelbases]."""
LABEL_HEIGHT = 4.5
"""Height of the label above the body [wheel radii]."""


class FailureMark:
    """A ghost of the whole rover where the shown path is refused, until another one is shown."""

    def __init__(self, scene: Any, nodes: Nodes, frame: LocalFrame):
        """Draw nothing yet."""
        self._scene, self._nodes, self._frame = scene, nodes, frame
        self._rover: Rover | None = None
        """The rover of the ghost, which stays for the next failure; None if there is none."""
        self._failure: Failure | None = None
        self._root: Any = None
        self._ghost: RoverVisual
        self._arrows: ForceArrows
        self._is_alone = True
        """True if the played rover is elsewhere."""
        self._forces_shown = True

    def show(self, rover: Rover, failure: Failure | None) -> None:
        """Draw a failure instead of what was drawn before; None draws nothing."""
        self._failure, self._is_alone = failure, True
        if failure is None:
            self._nodes.remove(REASON)
            if self._root is not None:
                self._root.visible = False
            return
        if self._rover is None or not look_alike(self._rover, rover):
            self._build(rover)
        self._root.visible = True
        self._ghost.show(failure.state, failure.link)
        if failure.is_settled:
            self._arrows.show(failure.state)
        self._show_alone()
        self._draw_label(failure, rover.wheel.radius)

    def _build(self, rover: Rover) -> None:
        """Add the nodes for a rover instead of those of another one."""
        if self._root is not None:
            self._root.remove()  # what is below it goes with it
        self._root = self._scene.add_frame(NAME, show_axes=False)
        self._ghost = RoverVisual(self._scene, rover, self._frame, f"{NAME}/rover", OPACITY)
        self._arrows = ForceArrows(self._scene, rover, self._frame, f"{NAME}/forces")
        self._rover = rover

    def make_room(self, state: RoverState | None) -> str:
        """Hide the ghost while the played rover stands there; return the link of it that fails."""
        failure = self._failure
        if failure is None or self._rover is None:
            return ""
        wheels, away = self._rover.suspension.wheels, np.inf
        if state is not None:
            away = float(np.linalg.norm(state.position - failure.state.position))
        is_alone = away > NEAR * (wheels["front"][0] - wheels["rear"][0])
        if is_alone != self._is_alone:
            self._is_alone = is_alone
            self._show_alone()
        return "" if is_alone else failure.link

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = visible
        self._show_alone()

    def _show_alone(self) -> None:
        """Show ghost and arrows, if they are known, while the played rover is elsewhere."""
        if self._failure is not None:
            self._ghost.root.visible = self._is_alone
            shown = self._forces_shown and self._failure.is_settled
            self._arrows.root.visible = shown and self._is_alone

    def _draw_label(self, failure: Failure, radius: float) -> None:
        """Draw what is broken, with a line from a place above the rover to the wheel or body."""
        where = f"after {failure.distance:.2f} m" + (
            ", between waypoints" if failure.is_between else ""
        )
        words, state = failure.headline.replace(", ", "\n", 1), failure.state
        place = state.position
        if failure.link in WHEELS:
            place = state.wheel_centres[WHEELS.index(failure.link)]
        top = self._frame.to_scene(state.position) + np.array([0.0, 0.0, LABEL_HEIGHT * radius])
        leader = Strand(np.array([top, self._frame.to_scene(place)]), CASING)
        self._nodes.show_lines(f"{REASON}/leader", [leader], 2.0)
        self._nodes.show_label(f"{REASON}/words", f"{words}\n{where}", top)
