# SPDX-License-Identifier: Apache-2.0
"""A rover in the scene with the forces on its wheels: the one that is played, or a ghost."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.rover_visual import RoverVisual
from rover_planner.viewer.state.colours import LOAD, TRACTION
from rover_planner.viewer.state.rover_state import RoverState

WEIGHT_LENGTH = 4.0
"""Length of the arrow of a sixth of the rover's weight [wheel radii]."""


class ForceArrows:
    """An arrow for each normal force, and one for each force along the ground."""

    def __init__(self, scene: Any, rover: Rover, frame: LocalFrame, name: str):
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


class DrawnRover:
    """Nodes of a rover, which stay for the next rover that looks the same."""

    root: Any
    """The node of which all others are parts."""
    visual: RoverVisual
    """Body, suspension, wheels and arm."""

    def __init__(self, scene: Any, frame: LocalFrame, name: str, opacity: float | None = None):
        """Draw nothing yet; nodes will be below a node `name`, opaque without an opacity."""
        self._scene, self._frame, self._name, self._opacity = scene, frame, name, opacity
        self.rover: Rover | None = None
        """The rover; None before the first."""
        self._arm: dict[str, float] = {}
        self._forces_shown = True
        self.state: RoverState | None = None
        """The state that is shown; None hides the rover."""

    def take(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Draw another rover, with its arm at angles [rad] by joint name.

        Of a rover that looks like the last one, only the arm is turned.
        """
        if self.rover is None or not look_alike(self.rover, rover):
            if self.rover is not None:
                self.root.remove()  # what is below it goes with it
            self.rover = None  # an error must not leave half a rover
            self.root = self._scene.add_frame(self._name, show_axes=False)
            links, forces = f"{self._name}/links", f"{self._name}/forces"
            self.visual = RoverVisual(self._scene, rover, self._frame, links, self._opacity)
            self._arrows = ForceArrows(self._scene, rover, self._frame, forces)
            self.rover, self._arm = rover, {}
            self.show_forces(self._forces_shown)
            self.show(self.state)
        if dict(arm_angles) != self._arm:
            self.visual.turn_arm(rover, arm_angles)
            self._arm = dict(arm_angles)

    def show(self, state: RoverState | None, failing: str = "") -> None:
        """Show rover and forces in a state, with a failing link as in `RoverVisual.show`."""
        self.state = state
        if self.rover is not None:
            self.root.visible = state is not None
            if state is not None:
                self.visual.show(state, failing)
                self._arrows.show(state)

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = visible
        if self.rover is not None:
            self._arrows.root.visible = visible


def look_alike(one: Rover, other: Rover) -> bool:
    """Return whether two rovers are drawn the same, with their forces."""
    wheel = replace(one.wheel, max_torque=other.wheel.max_torque)
    friction, speed, limits = other.friction, other.nominal_speed, other.limits
    return (
        replace(one, wheel=wheel, friction=friction, nominal_speed=speed, limits=limits) == other
    )
