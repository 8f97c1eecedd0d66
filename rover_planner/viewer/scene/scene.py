# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, the paths over the ground, and the cameras of visitors."""

from collections.abc import Collection
from typing import Any

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.steering_joints import swing_radius
from rover_planner.viewer.scene.canvas import Canvas, Strand
from rover_planner.viewer.scene.drawn_rover import DrawnRover
from rover_planner.viewer.scene.overlays import PathOverlay
from rover_planner.viewer.state.colours import CASING
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
GHOST, REASON = "/failure", "/reason"
OPACITY = 0.55
"""Opacity of the ghost."""
NEAR = 0.5
"""Distance of the played rover at which the ghost makes room for it [wheelbases]."""
LABEL_HEIGHT = 4.5
"""Height of the label above the body [wheel radii]."""


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
        self.path_places: Floats = np.zeros((1, 2))
        """(n, 2) x and y of the path that cameras look at [m]; its height is 0 where the ground is
        not known."""
        self.rover = DrawnRover(self.canvas, "/rover")
        self.ghost = DrawnRover(self.canvas, GHOST, OPACITY)
        """The rover where the shown path is refused; no forces are drawn where none are known."""

    def mark_failure(self, failure: Failure | None) -> None:
        """Draw a ghost where a path fails, and what is broken, with a line to the wheel or body.

        None draws nothing.
        """
        if failure is None:
            self.canvas.remove(REASON)
            self.ghost.show(None)
            return
        state, link = failure.state, failure.link
        self.ghost.take(state.rover, {})
        self.ghost.show(state, link)
        top = state.position + np.array([0.0, 0.0, LABEL_HEIGHT * state.rover.wheel.radius])
        place = state.wheel_centres[WHEELS.index(link)] if link in WHEELS else state.position
        self.canvas.show_lines(f"{REASON}/leader", [Strand(np.array([top, place]), CASING)], 2.0)
        words = failure.headline.replace(", ", "\n", 1)
        self.canvas.show_label(f"{REASON}/words", f"{words}\n{failure.place}", top)

    def show(self, state: RoverState | None, failure: Failure | None = None) -> None:
        """Show rover and forces in a state; hide them for None.

        While the rover stands where its path fails, it shows what fails in place of the ghost.
        """
        before, failing = self.rover.state, ""
        with self._server.atomic():
            if failure is not None:
                there, away = failure.state, np.inf
                if state is not None:
                    away = float(np.linalg.norm(state.position - there.position))
                is_away = away > NEAR * there.rover.wheelbase
                self.canvas.show_frame(GHOST, visible=is_away)
                failing = "" if is_away else failure.link
            self.rover.show(state, failing)
            if self._follows and before is not None and state is not None:
                by = state.position - before.position
                for client in self._clients():
                    client.camera.position = client.camera.position + by

    def look(self, view: str, clients: Collection[Any] | None = None) -> None:
        """Let cameras look at a path, or at the rover on it.

        Args:
            view: FIT all of the path from behind and beside; TOP the same from above, north at
                the top; SIDE the rover from the right side of its path; START along the path from
                behind and beside its start.
            clients: The clients of viser of the cameras' visitors (default: all).
        """
        rover, state = self.rover.rover, self.rover.state
        if rover is None:
            return
        path = self.canvas.lay(self.path_places, 0.0, 0.0)
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
                # From there, a ball of the radius just fits into the visitor's picture.
                camera, ball = client.camera, max(radius + rover.wheel.radius, least)
                width, height, fov = camera.image_width, camera.image_height, camera.fov
                narrow = min(width / height, 1.0) if height else 1.0
                away = MARGIN * ball / np.sin(0.5 * (fov if fov > 0.1 else 1.0)) / narrow
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
