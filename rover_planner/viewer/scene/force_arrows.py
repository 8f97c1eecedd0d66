"""The forces of the ground on the wheels, as arrows at the contacts."""

from typing import Any

import numpy as np

from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy
from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.colours import LOAD, PULL
from rover_planner.viewer.state.journey import Frame

LENGTH = 4.0
"""Length of the arrow for a sixth of the rover's weight, in wheel radii."""


class ForceArrows:
    """Arrows for the normal forces, and for what acts along the ground."""

    def __init__(self, scene: Any, rover: Rover):
        self._scale = LENGTH * rover.wheel.radius / (rover.weight / 6.0)
        radius = rover.wheel.radius
        nothing = np.zeros((6, 2, 3))
        sizes = {
            "shaft_radius": 0.07 * radius,
            "head_radius": 0.16 * radius,
            "head_length": 0.35 * radius,
        }
        self._normal = scene.add_arrows("/forces/normal", nothing, LOAD, **sizes)
        self._along = scene.add_arrows("/forces/along", nothing, PULL, **sizes)

    def show(self, frame: Frame) -> None:
        """Draw the forces of a frame; their length is in proportion, 0 where not known."""
        R = matrix_from_xyzw(xyzw_from_rpy(*frame.attitude))
        axis = R[:, 1]
        out = frame.wheel_centres - frame.contact_points
        normal = out - np.outer(out @ axis, axis)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        along = np.cross(axis, normal)
        points = frame.contact_points
        load, pull, aside = (
            self._scale * np.nan_to_num(values)[:, None]
            for values in (frame.wheel_loads, frame.tangential, frame.lateral)
        )
        loads, pulls = load * normal, pull * along + aside * axis
        self._normal.points = np.stack([points, points + loads], axis=1)
        self._along.points = np.stack([points, points + pulls], axis=1)

    @property
    def visible(self) -> bool:
        """Whether they are shown."""
        return bool(self._normal.visible)

    @visible.setter
    def visible(self, value: bool) -> None:
        self._normal.visible = self._along.visible = value
