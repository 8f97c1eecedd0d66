# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, and the paths over the ground."""

from typing import Any

from rover_planner.viewer.scene.cameras import Cameras
from rover_planner.viewer.scene.canvas import Canvas
from rover_planner.viewer.scene.drawn_rover import DrawnRover
from rover_planner.viewer.scene.failure_mark import FailureMark
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.state.rover_state import RoverState


class Scene:
    """All nodes of the scene; a new state of the rover sends poses, wheel colours and arrows."""

    def __init__(self, server: Any):
        """Set up the lights of an empty scene."""
        self._server = server
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(environment_intensity=0.25)
        self.canvas = Canvas(server.scene)
        """Its nodes; all that is drawn goes through it."""
        self.paths = PathOverlay(self.canvas)
        self.rover = DrawnRover(self.canvas, "/rover")
        self.failure = FailureMark(self.canvas)
        self.cameras = Cameras(server, self.canvas, self.rover)
        """The visitors' cameras."""

    def draw_ground(self, glb: bytes) -> None:
        """Show another ground, as `write_ground` returns it, or the same in other colours."""
        self._server.scene.add_glb("/ground", glb, cast_shadow=False, receive_shadow=False)

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        for one in (self.rover, self.failure.ghost):
            one.show_forces(visible)

    def show(self, state: RoverState | None) -> None:
        """Show rover and forces in a state; hide them for None."""
        before = self.rover.state
        with self._server.atomic():
            self.rover.show(state, self.failure.make_room(state))
            if before is not None and state is not None:
                self.cameras.go_along(state.position - before.position)
