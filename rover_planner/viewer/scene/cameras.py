# SPDX-License-Identifier: Apache-2.0
"""The cameras of all visitors: where they look from, and whether they go along with the rover."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.scene.local_frame import LocalFrame

FIT, TOP, SIDE = "Fit", "Top", "Side"
VIEWS = (FIT, TOP, SIDE)
"""Views that a visitor can choose."""
SLANT = 0.9
"""Height of a slanted view over its horizontal distance."""
MARGIN = 1.15
"""Factor on the distance from which something just fits into the picture."""
MIN_AWAY = 12.0
"""Smallest distance of a camera from what it looks at [wheel radii]."""


@dataclass(frozen=True, eq=False)
class Target:
    """What a camera looks at, map frame."""

    points: Floats
    """(n, 3) points that a view shall show [m]: the path, or the ground."""
    rover: Floats
    """(3,) position of the rover [m]."""
    ahead: Floats
    """(2,) direction of the path, of length 1."""
    wheel_radius: float
    """[m]"""
    rover_radius: float = 0.0
    """Radius of a circle around the rover, which may stand at any of the points [m]."""

    @property
    def middle(self) -> Floats:
        """(3,) middle of the points [m]."""
        return 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))

    @property
    def radius(self) -> float:
        """Radius of a ball around the middle that contains the rover at all points [m]."""
        away = float(np.linalg.norm(self.points - self.middle, axis=1).max()) + self.rover_radius
        return max(away, MIN_AWAY * self.wheel_radius)


class Cameras:
    """Places the cameras of visitors."""

    def __init__(self, server: Any, frame: LocalFrame):
        """Move no camera yet."""
        self._server, self._frame = server, frame
        self.follows = False
        """Whether the cameras go along with the rover."""

    def look(self, client: Any, view: str, target: Target) -> None:
        """Let a visitor's camera look at a target.

        Args:
            client: The visitor's client of viser.
            view: FIT all points from behind and beside; TOP all points from above, north at the
                top; SIDE the rover from the right side of its path.
            target: What to look at.
        """
        fov, aspect = _field_of_view(client)
        beside = np.array([target.ahead[1], -target.ahead[0]])
        if view in (FIT, TOP):
            centre = target.middle
            away = MARGIN * target.radius / np.sin(0.5 * fov) / min(aspect, 1.0)
            flat = 0.45 * beside - 0.65 * target.ahead
            offset = np.array([*flat, SLANT]) if view == FIT else np.array([0.0, -1e-3, 1.0])
            offset *= away / np.linalg.norm(offset)
        else:
            centre, away = target.rover, 1.5 * MIN_AWAY * target.wheel_radius
            offset = away * np.array([*beside, 0.25])
        self._place(client, centre + offset, centre)

    def aim(self, client: Any, first: Floats, ahead: Floats, wheel_radius: float) -> None:
        """Aim a visitor's camera along a line, from behind and beside its start.

        Args:
            client: The visitor's client of viser.
            first: (3,) start of the line [m], map frame.
            ahead: (2,) from the start of the line to its end [m].
            wheel_radius: [m]
        """
        length = max(float(np.linalg.norm(ahead)), 1.0)
        beside = np.array([ahead[1], -ahead[0]]) / length
        away = min(0.25 * length, 3.0) + 0.5 * MIN_AWAY * wheel_radius
        flat = 0.9 * beside - 0.8 * ahead / length
        position = first + away * np.array([*flat, SLANT])
        self._place(client, position, first + np.array([*(0.12 * ahead), 0.0]))

    def centre(self, place: Floats) -> None:
        """Let all cameras look at a place (3,) [m] from the same side and distance as before."""
        for client in self._server.get_clients().values():
            here = self._frame.to_map(client.camera.position)
            offset = here - self._frame.to_map(client.camera.look_at)
            self._place(client, place + offset, place)

    def go_along(self, by: Floats) -> None:
        """Move all cameras by (3,) [m] if they go along with the rover."""
        if self.follows:
            for client in self._server.get_clients().values():
                client.camera.position = client.camera.position + by

    def _place(self, client: Any, position: Floats, look_at: Floats) -> None:
        client.camera.position = self._frame.to_scene(position)
        client.camera.look_at = self._frame.to_scene(look_at)


def _field_of_view(client: Any) -> tuple[float, float]:
    """Return the vertical field of view [rad] and width over height of a visitor's picture."""
    camera = client.camera
    fov, height = float(camera.fov), float(camera.image_height)
    return (fov if fov > 0.1 else 1.0), (float(camera.image_width) / height if height else 1.0)
