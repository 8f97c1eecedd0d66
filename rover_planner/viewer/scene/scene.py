# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, the paths over the ground, and the cameras of visitors."""

from collections.abc import Collection
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.steering_joints import swing_radius
from rover_planner.viewer.scene.canvas import Canvas
from rover_planner.viewer.scene.drawn_rover import DrawnRover, FailureMark
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.state.drive import RoverState
from rover_planner.viewer.state.path_limits import Failure

FIT, TOP, SIDE, START = "Fit", "Top", "Side", "Start"
VIEWS = (FIT, TOP, SIDE)
"""Views that a visitor can choose."""
SLANT = 0.9
"""Height of a slanted view over its horizontal distance."""
MARGIN = 1.15
"""Factor on the distance from which something just fits into the picture."""
MIN_AWAY = 12.0
"""Smallest distance of a camera from what it looks at [wheel radii]."""


class Scene:
    """All nodes of the scene, and the cameras of its visitors, which may go along with the rover.

    A new state of the rover sends poses, wheel colours and arrows.
    """

    def __init__(self, server: Any):
        """Set up the lights of an empty scene."""
        self._server, self._follows = server, False
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(environment_intensity=0.25)
        self.canvas = Canvas(server.scene)
        """Its nodes; all that is drawn goes through it."""
        self.paths = PathOverlay(self.canvas)
        self.rover = DrawnRover(self.canvas, "/rover")
        self.failure = FailureMark(self.canvas)

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
            if self._follows and before is not None and state is not None:
                by = state.position - before.position
                for client in self._clients():
                    client.camera.position = client.camera.position + by

    def look(self, view: str, points: Floats, clients: Collection[Any] | None = None) -> None:
        """Let cameras look at a path, or at the rover on it.

        Args:
            view: FIT all of the path from behind and beside; TOP the same from above, north at
                the top; SIDE the rover from the right side of its path; START along the path from
                behind and beside its start.
            points: (n, 2) x and y of the path [m]; where the ground is not known, its height is 0.
            clients: The clients of viser of the cameras' visitors (default: all).
        """
        rover, state = self.rover.rover, self.rover.state
        if rover is None:
            return
        path = self.canvas.lay(points, 0.0, 0.0)
        ahead = path[-1, :2] - path[0, :2]
        length = float(np.linalg.norm(ahead))
        ahead = ahead / length if length > 0.0 else np.array([1.0, 0.0])
        beside, least = np.array([ahead[1], -ahead[0]]), MIN_AWAY * rover.wheel.radius
        for client in self._clients() if clients is None else clients:
            if view == SIDE:
                at = path[0] if state is None else state.position
                self._place(client, at, at + 1.5 * least * np.array([*beside, 0.25]))
            elif view == START:
                away = min(0.25 * max(length, 1.0), 3.0) + 0.5 * least
                towards = np.array([*(0.9 * beside - 0.8 * ahead), SLANT])
                at = path[0] + [*(0.12 * length * ahead), 0.0]
                self._place(client, at, path[0] + away * towards)
            else:
                at = 0.5 * (path.min(axis=0) + path.max(axis=0))
                radius = float(np.linalg.norm(path - at, axis=1).max()) + swing_radius(rover)
                flat = 0.45 * beside - 0.65 * ahead
                towards = np.array([*flat, SLANT] if view == FIT else [0.0, -1e-3, 1.0])
                away = _distance_of(client, max(radius + rover.wheel.radius, least))
                self._place(client, at, at + away * towards / np.linalg.norm(towards))

    def follow(self, follows: bool) -> None:
        """Go along with the rover or not; first look at it from the same side and distance."""
        self._follows = follows
        if follows and self.rover.state is not None:
            at = self.rover.state.position
            for client in self._clients():
                self._place(client, at, at + client.camera.position - client.camera.look_at)

    def look_at_failure(self, failure: Failure) -> None:
        """Let all cameras look at a failure, from the side of what fails."""
        rover, yaw, at = failure.state.rover, failure.state.attitude[2], failure.state.position
        size = rover.suspension.wheels["front"][0] - rover.belly.x[0]
        side = -1.0 if "right" in failure.link else 1.0
        ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        offset = size * np.array([*(-0.9 * ahead + side * 2.2 * left), 1.3])
        for client in self._clients():
            self._place(client, at, at + offset)

    def _clients(self) -> Collection[Any]:
        return list(self._server.get_clients().values())

    def _place(self, client: Any, look_at: Floats, position: Floats) -> None:
        client.camera.position = self.canvas.to_scene(position)
        client.camera.look_at = self.canvas.to_scene(look_at)


def _distance_of(client: Any, radius: float) -> float:
    """Return the distance [m] from which a ball of a radius fits into a visitor's picture."""
    camera = client.camera
    fov, width, height = camera.fov, camera.image_width, camera.image_height
    narrow = min(width / height, 1.0) if height else 1.0
    return float(MARGIN * radius / np.sin(0.5 * (fov if fov > 0.1 else 1.0)) / narrow)
