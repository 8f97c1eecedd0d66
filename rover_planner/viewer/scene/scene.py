# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, the paths over the ground, and the cameras of visitors."""

from collections.abc import Collection
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
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


class Cameras:
    """Places the cameras of visitors, and lets them go along with a rover that is drawn."""

    def __init__(self, server: Any, canvas: Canvas, drawn: DrawnRover):
        """Move no camera yet."""
        self._server, self._canvas, self._drawn = server, canvas, drawn
        self._follows = False

    def look(self, clients: Collection[Any], view: str, points: Floats) -> None:
        """Let cameras look at a path, or at the rover on it.

        Args:
            clients: The clients of viser of the cameras' visitors.
            view: FIT all of the path from behind and beside; TOP the same from above, north at
                the top; SIDE the rover from the right side of its path; START along the path from
                behind and beside its start.
            points: (n, 2) x and y of the path [m]; where the ground is not known, its height is 0.
        """
        rover, state = self._drawn.rover, self._drawn.state
        if rover is None:
            return
        path = self._canvas.lay(points, 0.0, 0.0)
        ahead = path[-1, :2] - path[0, :2]
        length = float(np.linalg.norm(ahead))
        ahead = ahead / length if length > 0.0 else np.array([1.0, 0.0])
        beside, least = np.array([ahead[1], -ahead[0]]), MIN_AWAY * rover.wheel.radius
        for client in clients:
            if view == SIDE:
                towards, away = np.array([*beside, 0.25]), 1.5 * least
                middle = path[0] if state is None else state.position
            elif view == START:
                towards = np.array([*(0.9 * beside - 0.8 * ahead), SLANT])
                away = min(0.25 * max(length, 1.0), 3.0) + 0.5 * least
                middle = path[0] + [*(0.12 * length * ahead), 0.0]
            else:
                fov, aspect = _field_of_view(client)
                middle = 0.5 * (path.min(axis=0) + path.max(axis=0))
                radius = (
                    float(np.linalg.norm(path - middle, axis=1).max())
                    + swing_radius(rover)
                    + rover.wheel.radius
                )
                flat = 0.45 * beside - 0.65 * ahead
                towards = np.array([*flat, SLANT] if view == FIT else [0.0, -1e-3, 1.0])
                towards /= np.linalg.norm(towards)
                away = MARGIN * max(radius, least) / np.sin(0.5 * fov) / min(aspect, 1.0)
            from_here = path[0] if view == START else middle
            self._place(client, from_here + away * towards, middle)

    def follow(self, follows: bool) -> None:
        """Go along with the rover or not; first look at it from the same side and distance."""
        self._follows = follows
        if follows and self._drawn.state is not None:
            place = self._drawn.state.position
            for client in self._clients():
                offset = client.camera.position - client.camera.look_at
                self._place(client, place + offset, place)

    def look_at_failure(self, rover: Rover, failure: Failure) -> None:
        """Let all cameras look at a failure, from the side of what fails."""
        yaw, at = float(failure.state.attitude[2]), failure.state.position
        size = rover.suspension.wheels["front"][0] - rover.belly.x[0]
        side = -1.0 if "right" in failure.link else 1.0
        ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        offset = size * np.array([*(-0.9 * ahead + side * 2.2 * left), 1.3])
        for client in self._clients():
            self._place(client, at + offset, at)

    def go_along(self, by: Floats) -> None:
        """Move all cameras by (3,) [m] if they go along with the rover."""
        if self._follows:
            for client in self._clients():
                client.camera.position = client.camera.position + by

    def _clients(self) -> list[Any]:
        return list(self._server.get_clients().values())

    def _place(self, client: Any, position: Floats, look_at: Floats) -> None:
        client.camera.position = self._canvas.to_scene(position)
        client.camera.look_at = self._canvas.to_scene(look_at)


def _field_of_view(client: Any) -> tuple[float, float]:
    """Return the vertical field of view [rad] and width over height of a visitor's picture."""
    camera = client.camera
    fov, height = float(camera.fov), float(camera.image_height)
    return (fov if fov > 0.1 else 1.0), (float(camera.image_width) / height if height else 1.0)


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
