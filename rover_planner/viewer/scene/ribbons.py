# SPDX-License-Identifier: Apache-2.0
"""Lines over the ground of one width in pixels, each in the colours of its strands."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.state.colours import Colour, to_linear


@dataclass(frozen=True, eq=False)
class Strand:
    """A part of a ribbon."""

    line: Floats
    """(n, 3) its points [m], frame of the scene, n >= 2."""
    colour: Colour
    """Its colour."""

    def looks_like(self, other: "Strand") -> bool:
        """Return whether two strands are drawn the same."""
        return self.colour == other.colour and np.array_equal(self.line, other.line)


class Ribbon:
    """Strands of one width in pixels, so that they are seen from any distance.

    All strands together are one node of the scene, which stays when they change: a new node takes
    the page longer than new points.
    """

    def __init__(self, scene: Any, name: str):
        """Draw nothing yet; the node will have the name `name`."""
        self._scene, self.name = scene, name
        self.strands: tuple[Strand, ...] = ()
        """The drawn strands, in their own colours."""
        self._drawn: tuple[float, Colour | None] | None = None
        self._node: Any = None

    def show(self, strands: Sequence[Strand], width: float, paint: Colour | None = None) -> None:
        """Draw strands instead of what was drawn before; what looks the same is not sent again.

        Args:
            strands: The strands.
            width: Width of their lines [px].
            paint: Colour of all of them (default: each in its own).
        """
        same = len(strands) == len(self.strands) and all(
            one.looks_like(other) for one, other in zip(strands, self.strands, strict=True)
        )
        if same and self._drawn == (width, paint):
            return
        if not strands:
            self.remove()
            return
        self.strands, self._drawn = tuple(strands), (width, paint)
        lines = [np.stack([one.line[:-1], one.line[1:]], axis=1) for one in strands]
        points = np.concatenate(lines).astype(np.float32)
        colours = np.repeat(
            to_linear(np.array([paint or one.colour for one in strands])),
            [len(line) for line in lines],
            axis=0,
        )[:, None].repeat(2, axis=1)
        self._draw(points, colours, width)

    def paint(self, colour: Colour | None) -> None:
        """Show all strands in a colour, or each in its own again."""
        if self._drawn is not None:
            self.show(self.strands, self._drawn[0], colour)

    def remove(self) -> None:
        """Remove it."""
        if self._node is not None:
            self._node.remove()
        self._node, self.strands, self._drawn = None, (), None

    def _draw(self, points: np.ndarray, colours: np.ndarray, width: float) -> None:
        if self._node is not None:
            self._node.points, self._node.colors, self._node.thickness = points, colours, width
            return
        self._node = self._scene.add_line_segments(
            self.name, points, colours, thickness=width, thickness_units="screen"
        )
