# SPDX-License-Identifier: Apache-2.0
"""The place of a failure in the scene: a ghost of the rover, the link that fails, the forces."""

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.canvas import Canvas, Strand
from rover_planner.viewer.scene.drawn_rover import DrawnRover
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

    def __init__(self, canvas: Canvas):
        """Draw nothing yet."""
        self._canvas = canvas
        self.ghost = DrawnRover(canvas, NAME, OPACITY)
        """The ghost; no forces are drawn where they are not known."""
        self._failure: Failure | None = None
        self._near = 0.0

    def show(self, rover: Rover, failure: Failure | None) -> None:
        """Draw a failure instead of what was drawn before; None draws nothing."""
        self._failure = failure
        if failure is None:
            self._canvas.remove(REASON)
            self.ghost.show(None)
            return
        wheels = rover.suspension.wheels
        self._near = NEAR * (wheels["front"][0] - wheels["rear"][0])
        self.ghost.take(rover, {})
        self.ghost.show(failure.state, failure.link)
        self._draw_label(failure, rover.wheel.radius)

    def make_room(self, state: RoverState | None) -> str:
        """Hide the ghost while the played rover stands there; return the link of it that fails."""
        failure, away = self._failure, np.inf
        if failure is None:
            return ""
        if state is not None:
            away = float(np.linalg.norm(state.position - failure.state.position))
        self._canvas.show_frame(NAME, visible=away > self._near)
        return "" if away > self._near else failure.link

    def _draw_label(self, failure: Failure, radius: float) -> None:
        """Draw what is broken, with a line from a place above the rover to the wheel or body."""
        where = f"after {failure.distance:.2f} m" + (
            ", between waypoints" if failure.is_between else ""
        )
        words, state = failure.headline.replace(", ", "\n", 1), failure.state
        place = state.position
        if failure.link in WHEELS:
            place = state.wheel_centres[WHEELS.index(failure.link)]
        top = state.position + np.array([0.0, 0.0, LABEL_HEIGHT * radius])
        leader = Strand(np.array([top, place]), CASING)
        self._canvas.show_lines(f"{REASON}/leader", [leader], 2.0)
        self._canvas.show_label(f"{REASON}/words", f"{words}\n{where}", top)
