# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, and the paths over the ground."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_physics.names import WHEEL_POSITIONS
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.cameras import FIT, Cameras, Target
from rover_planner.viewer.scene.failure_mark import FailureMark
from rover_planner.viewer.scene.force_arrows import ForceArrows
from rover_planner.viewer.scene.labels import Labels
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.scene.rover_visual import (
    RoverVisual,
    have_same_parts,
    look_alike,
)
from rover_planner.viewer.scene.search_overlay import SearchOverlay
from rover_planner.viewer.scene.turning_centre import TurningCentre
from rover_planner.viewer.state.reasons.failure import Failure
from rover_planner.viewer.state.trajectory import RoverState


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
        self.labels = Labels(server.gui)
        self.paths = PathOverlay(self._scene, self.labels, self.frame)
        self.search = SearchOverlay(self._scene, self.frame)
        self.failure = FailureMark(self._scene, self.labels, self.frame)
        self._rover: Rover
        self._visual: RoverVisual | None = None
        self._forces_shown = True
        self._arm: dict[str, float] = {}
        self._state: RoverState | None = None
        self._last_position: np.ndarray | None = None

    def draw_ground(self, glb: bytes) -> None:
        """Show another ground, as `export_ground` returns it, or the same in other colours."""
        self._scene.add_glb("/ground", glb, cast_shadow=False, receive_shadow=False)

    def draw_rover(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Show another rover, with its arm at angles [rad] by joint name.

        Of a rover that looks like the last one, only the arm is turned.
        """
        if self._visual is not None and look_alike(self._rover, rover):
            self.turn_arm(arm_angles)
            return
        visual, self._visual = self._visual, None  # an error must not leave half a rover
        if visual is not None and have_same_parts(self._rover, rover):
            visual.shape(rover, arm_angles)
        else:
            if visual is not None:
                visual.remove()
            visual = RoverVisual(self._scene, rover, "/rover", arm_angles, self.frame)
        self._visual, self._rover, self._arm = visual, rover, dict(arm_angles)
        self._forces = ForceArrows(self._scene, rover, self.frame)
        self._forces.visible = self._forces_shown
        self._centre = TurningCentre(self._scene, rover, self.frame)
        self.show(self._state)

    def turn_arm(self, angles: Mapping[str, float]) -> None:
        """Show the arm at angles [rad] by joint name."""
        if self._visual is not None and dict(angles) != self._arm:
            self._visual.turn_arm(self._rover, angles)
            self._arm = dict(angles)

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = self._forces.visible = visible
        self.failure.show_forces(visible)

    def show(self, state: RoverState | None) -> None:
        """Show rover and forces in a state; hide them for None."""
        self._state = state
        if self._visual is None:
            return
        self._visual.visible = state is not None
        self._forces.visible = self._forces_shown and state is not None
        self.failure.make_room(state)
        if state is None:
            self._centre.show(None)
            self._last_position = None
            return
        with self._server.atomic():
            self._visual.show(state)
            self._forces.show(state)
            self._centre.show(state)
            if self._last_position is not None:
                self.cameras.go_along(state.position - self._last_position)
        self._last_position = state.position

    def follow(self, follows: bool) -> None:
        """Let the cameras go along with the rover or not; first they look at it."""
        self.cameras.follows = follows
        if follows and self._last_position is not None:
            self.cameras.centre(self._last_position)

    def look_at_failure(self, rover: Rover, failure: Failure) -> None:
        """Let the cameras of all visitors look at a failure, from the side of what fails."""
        state, size = failure.state, rover.suspension.wheels["front"][0] - rover.belly.x[0]
        yaw = float(state.attitude[2])
        side = -1.0 if "right" in failure.link else 1.0
        ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        left = np.array([-ahead[1], ahead[0], 0.0])
        target = state.position
        place = target + size * (-0.9 * ahead + side * 2.2 * left + [0.0, 0.0, 1.3])
        for client in self._server.get_clients().values():
            client.camera.position = self.frame.to_scene(place)
            client.camera.look_at = self.frame.to_scene(target)

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
        height = float(np.nan_to_num(terrain.elevation_at(*start[:2])))
        ahead = np.subtract(goal[:2], start[:2])
        first = np.array([*start[:2], height])
        self.cameras.aim(client, first, ahead, rover.wheel.radius)

    def look(self, client: Any, view: str, terrain: Terrain, points: np.ndarray) -> None:
        """Let the camera of a visitor look at a path or at the rover on it.

        Args:
            client: The visitor's client of viser.
            view: One of VIEWS.
            terrain: The ground.
            points: (n, 2 or 3) x and y of the path [m], further values are not used.
        """
        flat = np.asarray(points, dtype=float)[:, :2]
        heights = np.nan_to_num(terrain.elevation_at(flat[:, 0], flat[:, 1]))
        path = np.column_stack([flat, heights])
        ahead = path[-1, :2] - path[0, :2]
        length = float(np.linalg.norm(ahead))
        ahead = ahead / length if length > 0.0 else np.array([1.0, 0.0])
        rover = path[0] if self._last_position is None else self._last_position
        target = Target(path, rover, ahead, self._rover.wheel.radius, find_radius(self._rover))
        self.cameras.look(client, view, target)

    def fit_all(self, terrain: Terrain, points: np.ndarray) -> None:
        """Let the cameras of all visitors look at a whole path, as `look` does."""
        for client in self._server.get_clients().values():
            self.look(client, FIT, terrain, points)


def find_radius(rover: Rover) -> float:
    """Return the radius of the circle around a rover, seen from above, that holds its wheels."""
    hubs = np.array([rover.suspension.wheels[name] for name in WHEEL_POSITIONS])
    return float(np.linalg.norm(hubs[:, :2], axis=1).max()) + rover.wheel.radius
