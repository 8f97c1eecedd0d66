"""The 3-D scene: ground, rover, forces, and the paths over the ground."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.force_arrows import ForceArrows
from rover_planner.viewer.scene.ground_mesh import as_unlit_glb
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.scene.rover_visual import RoverVisual
from rover_planner.viewer.scene.search_overlay import SearchOverlay
from rover_planner.viewer.scene.turning_centre import TurningCentre
from rover_planner.viewer.state.trajectory import RoverState


class Scene:
    """All nodes of the scene; a new state of the rover sends poses, wheel colours and arrows."""

    def __init__(self, server: Any):
        """Set up the lights of an empty scene."""
        self._server, self._scene = server, server.scene
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(environment_intensity=0.25)
        self.paths = PathOverlay(self._scene)
        self.search = SearchOverlay(self._scene)
        self.follows = False
        """Whether the cameras move with the rover."""
        self._forces_shown = True
        self._arm: dict[str, float] = {}
        self._last_position: np.ndarray | None = None

    def draw_ground(self, mesh: trimesh.Trimesh) -> None:
        """Show another ground, or the same in other colours."""
        glb = as_unlit_glb(mesh)
        self._scene.add_glb("/ground", glb, cast_shadow=False, receive_shadow=False)

    def draw_rover(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Show another rover, with its arm at angles [rad] by joint name."""
        self._rover, self._arm = rover, dict(arm_angles)
        self._visual = RoverVisual(self._scene, rover, "/rover", arm_angles)
        self._forces = ForceArrows(self._scene, rover)
        self._forces.visible = self._forces_shown
        self._centre = TurningCentre(self._scene, rover)

    def turn_arm(self, angles: Mapping[str, float]) -> None:
        """Show the arm at angles [rad] by joint name."""
        if dict(angles) != self._arm:
            self._visual.turn_arm(self._rover, angles)
            self._arm = dict(angles)

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = self._forces.visible = visible

    def show(self, state: RoverState | None) -> None:
        """Show rover and forces in a state; hide them for None."""
        self._visual.visible = state is not None
        self._forces.visible = self._forces_shown and state is not None
        if state is None:
            self._centre.show(None)
            self._last_position = None
            return
        with self._server.atomic():
            self._visual.show(state)
            self._forces.show(state)
            self._centre.show(state)
            if self.follows and self._last_position is not None:
                self._move_cameras(state.position - self._last_position)
        self._last_position = state.position

    def _move_cameras(self, by: np.ndarray) -> None:
        for client in self._server.get_clients().values():
            client.camera.position = client.camera.position + by

    def aim_camera(
        self, client: Any, rover: Rover, terrain: Terrain, start: Any, goal: Any
    ) -> None:
        """Aim the camera of a visitor along the line from start to goal, from behind and beside.

        Args:
            client: The visitor's client of viser.
            rover: The rover, for its size.
            terrain: The ground.
            start: x and y [m], further values are not used.
            goal: The same.
        """
        first, ahead = np.array(start[:2]), np.subtract(goal[:2], start[:2])
        length = max(float(np.linalg.norm(ahead)), 1.0)
        beside = np.array([ahead[1], -ahead[0]]) / length
        height = float(np.nan_to_num(terrain.elevation_at(*first)))
        away = min(0.25 * length, 3.0) + 6.0 * rover.wheel.radius
        camera = first - 0.8 * away * ahead / length + 0.9 * away * beside
        client.camera.position = (*camera, height + 0.9 * away)
        client.camera.look_at = (*(first + 0.12 * ahead), height)
