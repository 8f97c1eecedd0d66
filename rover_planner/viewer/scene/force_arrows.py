# SPDX-License-Identifier: Apache-2.0
"""Arrows at the contacts: the forces of the ground on the wheels."""

from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.state.colours import LOAD, TRACTION
from rover_planner.viewer.state.rover_state import RoverState

WEIGHT_LENGTH = 4.0
"""Length of the arrow of a sixth of the rover's weight [wheel radii]."""


class ForceArrows:
    """An arrow for each normal force, and one for each force along the ground."""

    def __init__(self, scene: Any, rover: Rover, frame: LocalFrame, name: str = "/forces"):
        """Add arrows of no length to the scene, below a node `name`."""
        self._frame = frame
        self.root = scene.add_frame(name, show_axes=False)
        """The node of which all others are parts."""
        self._scale = WEIGHT_LENGTH * rover.wheel.radius / (rover.weight / 6.0)
        radius = rover.wheel.radius
        no_arrows = np.zeros((6, 2, 3))
        sizes = {
            "shaft_radius": 0.07 * radius,
            "head_radius": 0.16 * radius,
            "head_length": 0.35 * radius,
        }
        self._normal = scene.add_arrows(f"{name}/normal", no_arrows, LOAD, **sizes)
        self._along = scene.add_arrows(f"{name}/along", no_arrows, TRACTION, **sizes)

    def show(self, state: RoverState) -> None:
        """Draw the forces of a state, in proportion; one that is not known has no length."""
        axis, outwards = state.axles, state.wheel_centres - state.contact_points
        normal = outwards - (outwards * axis).sum(axis=1, keepdims=True) * axis
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        along = np.cross(axis, normal)
        points = self._frame.to_scene(state.contact_points)
        N, T, S = (
            self._scale * np.nan_to_num(values)[:, None]
            for values in (state.wheel_loads, state.tangential, state.lateral)
        )
        self._normal.points = np.stack([points, points + N * normal], axis=1)
        self._along.points = np.stack([points, points + (T * along + S * axis)], axis=1)
