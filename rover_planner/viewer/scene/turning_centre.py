# SPDX-License-Identifier: Apache-2.0
"""The centre of rotation in a curve, as a pole, and a line to each wheel."""

from typing import Any

import numpy as np
import trimesh

from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.state.colours import NOTICE
from rover_planner.viewer.state.trajectory import RoverState
from rover_planner.viewer.state.turning import find_turning_centre

POLE = 6.0, 0.12
"""Height and radius of the pole [wheel radii]."""


class TurningCentre:
    """A pole where the rover turns about, hidden on straight ways."""

    def __init__(self, scene: Any, rover: Rover, frame: LocalFrame | None = None):
        """Add the hidden pole to the scene; without a frame it is drawn in the map frame."""
        self._rover = rover
        self._frame = frame or LocalFrame()
        height, radius = (size * rover.wheel.radius for size in POLE)
        pole = trimesh.creation.cylinder(
            radius, segment=np.diag([0.0, 0.0, height])[1:], sections=12
        )
        self._pole = scene.add_mesh_simple(
            "/turning_centre/pole", pole.vertices, pole.faces, color=NOTICE, visible=False
        )
        self._lines = scene.add_line_segments(
            "/turning_centre/lines",
            np.zeros((6, 2, 3)),
            NOTICE,
            thickness=1.0,
            thickness_units="screen",
            visible=False,
        )

    def show(self, state: RoverState | None) -> None:
        """Show where a state turns about; hide the pole where it drives straight, or for None."""
        centre = None if state is None else find_turning_centre(self._rover, state)
        self._pole.visible = self._lines.visible = centre is not None
        if state is not None and centre is not None:
            self._pole.position = self._frame.to_scene(centre)
            # To the top of the pole: rising ground would hide lower lines.
            top = centre + np.array([0.0, 0.0, POLE[0] * self._rover.wheel.radius])
            lines = np.stack([state.wheel_centres, np.broadcast_to(top, (6, 3))], axis=1)
            self._lines.points = self._frame.to_scene(lines)
