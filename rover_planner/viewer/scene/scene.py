"""The 3-D scene: ground, rover, forces and what is drawn over the ground."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.force_arrows import ForceArrows
from rover_planner.viewer.scene.ground_mesh import Ground, as_unlit_glb
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.scene.rover_figure import RoverFigure
from rover_planner.viewer.state.journey import Frame


class Scene:
    """All nodes of the scene; per frame only poses, wheel colours and arrows are sent."""

    def __init__(self, server: Any):
        """Set up the light of an empty scene."""
        self._server, self._scene = server, server.scene
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(environment_intensity=0.25)
        self.paths = PathOverlay(self._scene)
        self.follows = False
        """Whether the cameras go along with the rover."""
        self._forces_shown = True
        self._arm: dict[str, float] = {}
        self._at: np.ndarray | None = None

    def draw_ground(self, ground: Ground) -> None:
        """Show another ground, or the same in other colours."""
        glb = as_unlit_glb(ground.mesh)
        self._scene.add_glb("/ground", glb, cast_shadow=False, receive_shadow=False)

    def hide_ground(self) -> None:
        """Take the ground away."""
        self._scene.remove_by_name("/ground")

    def draw_rover(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Show another rover, with its arm at angles [rad]."""
        self._rover, self._arm = rover, dict(arm_angles)
        self._figure = RoverFigure(self._scene, rover, "/rover", arm_angles)
        self._forces = ForceArrows(self._scene, rover)
        self._forces.visible = self._forces_shown

    def turn_arm(self, angles: Mapping[str, float]) -> None:
        """Show the arm at angles [rad] by joint name."""
        if dict(angles) != self._arm:
            self._arm = dict(angles)
            self._figure.turn_arm(self._rover, angles)

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = self._forces.visible = visible

    def show(self, frame: Frame | None) -> None:
        """Bring rover and forces to a frame, or hide them where there is none."""
        self._figure.visible = frame is not None
        self._forces.visible = self._forces_shown and frame is not None
        if frame is None:
            self._at = None
            return
        with self._server.atomic():
            self._figure.show(frame)
            self._forces.show(frame)
            if self.follows and self._at is not None:
                self._move_cameras(frame.position - self._at)
        self._at = frame.position

    def _move_cameras(self, by: np.ndarray) -> None:
        for client in self._server.get_clients().values():
            client.camera.position = client.camera.position + by

    def look_along(self, client: Any, rover: Rover, terrain: Terrain, start: Any, goal: Any):
        """Let a visitor look along the way from start to goal, from behind and beside."""
        first, ahead = np.array(start[:2]), np.subtract(goal[:2], start[:2])
        length = max(float(np.linalg.norm(ahead)), 1.0)
        beside = np.array([ahead[1], -ahead[0]]) / length
        height = float(np.nan_to_num(terrain.elevation_at(*first)))
        away = min(0.25 * length, 3.0) + 6.0 * rover.wheel.radius
        place = first - 0.8 * away * ahead / length + 0.9 * away * beside
        client.camera.position = (*place, height + 0.9 * away)
        client.camera.look_at = (*(first + 0.12 * ahead), height)
