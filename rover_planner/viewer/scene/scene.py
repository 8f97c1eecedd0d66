# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, and the paths over the ground."""

from collections.abc import Collection
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.cameras import Cameras
from rover_planner.viewer.scene.drawn_rover import DrawnRover
from rover_planner.viewer.scene.failure_mark import FailureMark
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.nodes import Nodes
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.state.rover_state import RoverState


class Scene:
    """All nodes of the scene; a new state of the rover sends poses, wheel colours and arrows."""

    def __init__(self, server: Any):
        """Set up the lights of an empty scene."""
        self._server, self._scene = server, server.scene
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(environment_intensity=0.25)
        self.frame = LocalFrame()
        """The frame of the scene; all that is drawn goes through it."""
        self.cameras = Cameras(server, self.frame)
        """The visitors' cameras."""
        nodes = Nodes(self._scene)
        self.paths = PathOverlay(nodes, self.frame)
        self.rover = DrawnRover(self._scene, self.frame, "/rover")
        self.failure = FailureMark(self._scene, nodes, self.frame)

    def draw_ground(self, glb: bytes) -> None:
        """Show another ground, as `write_ground` returns it, or the same in other colours."""
        self._scene.add_glb("/ground", glb, cast_shadow=False, receive_shadow=False)

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

    def follow(self, follows: bool) -> None:
        """Let the cameras go along with the rover or not; first they look at it."""
        self.cameras.follows = follows
        if follows and self.rover.state is not None:
            self.cameras.centre(self.rover.state.position)

    def look(self, clients: Collection[Any], view: str, terrain: Terrain, points: Floats) -> None:
        """Let cameras look at a path, or at the rover on it.

        Args:
            clients: The clients of viser of the cameras' visitors.
            view: A view of `Cameras.look`.
            terrain: The ground; where it is not known, the path has the height 0.
            points: (n, 2) x and y of the path [m].
        """
        heights = terrain.elevation_at(points[:, 0], points[:, 1])
        path = np.column_stack([points, np.nan_to_num(heights)])
        state, rover = self.rover.state, self.rover.rover
        at = path[0] if state is None else state.position
        if rover is not None:
            for client in clients:
                self.cameras.look(client, view, rover, path, at)
