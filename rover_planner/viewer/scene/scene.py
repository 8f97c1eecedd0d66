# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, and the paths over the ground."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.cameras import FIT, Cameras
from rover_planner.viewer.scene.failure_mark import FailureMark
from rover_planner.viewer.scene.force_arrows import ForceArrows
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.nodes import Nodes
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.scene.rover_visual import RoverVisual, look_alike
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
        self.failure = FailureMark(self._scene, nodes, self.frame)
        self._rover: Rover
        self._visual: RoverVisual | None = None
        self._forces_shown = True
        self._arm: dict[str, float] = {}
        self._state: RoverState | None = None
        self._last_position: np.ndarray | None = None

    def draw_ground(self, glb: bytes) -> None:
        """Show another ground, as `write_ground` returns it, or the same in other colours."""
        self._scene.add_glb("/ground", glb, cast_shadow=False, receive_shadow=False)

    def draw_rover(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Show another rover, with its arm at angles [rad] by joint name.

        Of a rover that looks like the last one, only the arm is turned.
        """
        if self._visual is None or not look_alike(self._rover, rover):
            visual, self._visual = self._visual, None  # an error must not leave half a rover
            if visual is not None:
                visual.root.remove()
            self._visual = RoverVisual(self._scene, rover, self.frame)
            self._rover, self._arm = rover, {}
            self._forces = ForceArrows(self._scene, rover, self.frame)
            self.show(self._state)
        self.turn_arm(arm_angles)

    def turn_arm(self, angles: Mapping[str, float]) -> None:
        """Show the arm at angles [rad] by joint name."""
        if self._visual is not None and dict(angles) != self._arm:
            self._visual.turn_arm(self._rover, angles)
            self._arm = dict(angles)

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = self._forces.root.visible = visible
        self.failure.show_forces(visible)

    def show(self, state: RoverState | None) -> None:
        """Show rover and forces in a state; hide them for None."""
        self._state = state
        if self._visual is None:
            return
        self._visual.root.visible = state is not None
        self._forces.root.visible = self._forces_shown and state is not None
        failing = self.failure.make_room(state)
        if state is None:
            self._last_position = None
            return
        with self._server.atomic():
            self._visual.show(state, failing)
            self._forces.show(state)
            if self._last_position is not None:
                self.cameras.go_along(state.position - self._last_position)
        self._last_position = state.position

    def follow(self, follows: bool) -> None:
        """Let the cameras go along with the rover or not; first they look at it."""
        self.cameras.follows = follows
        if follows and self._last_position is not None:
            self.cameras.centre(self._last_position)

    def look(self, client: Any, view: str, terrain: Terrain, points: Floats) -> None:
        """Let the camera of a visitor look at a path (n, 2) [m], or at the rover on it.

        Args:
            client: The visitor's client of viser.
            view: A view of `Cameras.look`.
            terrain: The ground.
            points: x and y of the path.
        """
        path = _lift(terrain, points)
        at = path[0] if self._last_position is None else self._last_position
        self.cameras.look(client, view, self._rover, path, at)

    def fit_all(self, terrain: Terrain, points: Floats) -> None:
        """Let the cameras of all visitors look at a whole path, as `look` does."""
        for client in self._server.get_clients().values():
            self.look(client, FIT, terrain, points)


def _lift(terrain: Terrain, points: Floats) -> Floats:
    """Return points (n, 2) on the ground (n, 3) [m]; unknown ground has the height 0."""
    heights = terrain.elevation_at(points[:, 0], points[:, 1])
    return np.column_stack([points, np.nan_to_num(heights)])
