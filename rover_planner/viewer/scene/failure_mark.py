# SPDX-License-Identifier: Apache-2.0
"""The place of a failure in the scene: a ghost of the rover, the link that fails, the forces."""

from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.viewer.scene.force_arrows import ForceArrows
from rover_planner.viewer.scene.labels import Label, Labels
from rover_planner.viewer.scene.link_outline import centre_of, outline_link
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.scene.rover_visual import RoverVisual, have_same_parts, look_alike
from rover_planner.viewer.state.colours import CASING, REFUSED
from rover_planner.viewer.state.failure import Failure
from rover_planner.viewer.state.trajectory import RoverState

NAME, LABELS = "/failure", "/reasons"
OPACITY = 0.55
"""Opacity of the ghost."""
NEAR = 0.5
"""Distance of the played rover at which the ghost makes room for it [wheelbases]."""
LABEL_HEIGHT = 4.5
"""Height of the label above the body [wheel radii]."""
OUTLINE_WIDTH = 5.0
"""Width of the outline of the link that fails [px]."""


class FailureMark:
    """A ghost of the whole rover where the shown path is refused, until another one is shown."""

    def __init__(self, scene: Any, labels: Labels, frame: LocalFrame):
        """Draw nothing yet."""
        self._scene, self._labels, self._frame = scene, labels, frame
        self._rover: Rover | None = None
        """The rover of the ghost; None if there is none."""
        self._failure: Failure | None = None
        self._root: Any = None
        self._nodes: list[Any] = []
        """Scene nodes of one failure; the ghost stays for the next one."""
        self._ghost: RoverVisual | None = None
        self._arrows: ForceArrows | None = None
        self._near = 0.0
        self._is_alone = True
        """True if the played rover is elsewhere."""
        self._forces_shown = True

    def show(self, rover: Rover, failure: Failure | None) -> None:
        """Draw a failure instead of what was drawn before; None draws nothing."""
        self._clear_failure()
        self._failure, self._is_alone = failure, True
        if failure is None:
            self._labels.show(LABELS, {})
            if self._root is not None:
                self._root.visible = False
            return
        state, scene, radius = failure.state, self._scene, rover.wheel.radius
        self._show_ghost(rover, failure)
        outline = outline_link(rover, state, failure.link)
        middle = self._frame.to_scene(centre_of(outline, state))
        outline = self._frame.to_scene(outline)
        if len(outline):
            self._nodes.append(
                scene.add_line_segments(
                    f"{NAME}/outline", outline.astype(np.float32), REFUSED,
                    thickness=OUTLINE_WIDTH, thickness_units="screen",
                )
            )  # fmt: skip
        top = self._frame.to_scene(state.position) + np.array([0.0, 0.0, LABEL_HEIGHT * radius])
        self._draw_label(failure, top, middle)

    def clear(self) -> None:
        """Remove all that was drawn but the label."""
        if self._root is not None:
            self._root.remove()  # what is below it goes with it
        self._nodes.clear()
        self._rover = self._root = self._failure = self._ghost = self._arrows = None

    def _clear_failure(self) -> None:
        """Remove what belongs to one failure."""
        for node in self._nodes:
            node.remove()
        self._nodes.clear()

    def _show_ghost(self, rover: Rover, failure: Failure) -> None:
        """Bring the ghost to a failure, with the forces."""
        if self._rover is None or not have_same_parts(self._rover, rover):
            self.clear()
            self._failure = failure
            self._root = self._scene.add_frame(NAME, show_axes=False)
            name = f"{NAME}/rover"
            self._ghost = RoverVisual(self._scene, rover, self._frame, name, OPACITY)
            self._add_arrows(rover)
        assert self._rover is not None and self._ghost is not None and self._arrows is not None
        if not look_alike(self._rover, rover):
            self._ghost.shape(rover)
            self._add_arrows(rover)
        self._root.visible = self._ghost.visible = True
        self._ghost.show(failure.state)
        self._show_arrows()
        if failure.is_settled:
            self._arrows.show(failure.state)

    def _add_arrows(self, rover: Rover) -> None:
        """Take a rover as that of the ghost; the forces are in proportion to its weight."""
        self._arrows = ForceArrows(self._scene, rover, self._frame, f"{NAME}/forces")
        wheels = rover.suspension.wheels
        self._near = NEAR * (wheels["front"][0] - wheels["rear"][0])
        self._rover = rover

    def _show_arrows(self) -> None:
        """Show the arrows if they are wanted and known, and the played rover is elsewhere."""
        if self._arrows is not None and self._failure is not None:
            settled = self._failure.is_settled
            self._arrows.visible = self._forces_shown and self._is_alone and settled

    def make_room(self, state: RoverState | None) -> None:
        """Hide the ghost, not its outline, while the played rover stands there."""
        if self._failure is None or self._ghost is None:
            return
        away = np.inf
        if state is not None:
            away = float(np.linalg.norm(state.position - self._failure.state.position))
        is_alone = away > self._near
        if is_alone == self._is_alone:
            return
        self._is_alone = self._ghost.visible = is_alone
        self._show_arrows()

    def show_forces(self, visible: bool) -> None:
        """Show or hide the arrows."""
        self._forces_shown = visible
        self._show_arrows()

    def _draw_label(self, failure: Failure, top: Floats, foot: Floats) -> None:
        """Draw what is broken, with a line from a place above the rover to the link."""
        where = f"after {failure.distance:.2f} m" + (
            ", between waypoints" if failure.is_between else ""
        )
        words = failure.headline.replace(", ", "\n", 1)
        leader = self._scene.add_line_segments(
            f"{NAME}/leader", np.array([[top, foot]]), CASING,
            thickness=2.0, thickness_units="screen",
        )  # fmt: skip
        label = Label(f"{words}\n{where}", top)
        self._labels.show(LABELS, {"reason": label})
        self._nodes.append(leader)
