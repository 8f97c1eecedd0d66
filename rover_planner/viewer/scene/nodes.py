# SPDX-License-Identifier: Apache-2.0
"""Lines and labels of the scene by name: shown, changed where they differ, and removed."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.state.colours import Colour, to_linear


@dataclass(frozen=True, eq=False)
class Strand:
    """A line of one colour."""

    line: Floats
    """(n, 3) its points [m], frame of the scene, n >= 2."""
    colour: Colour
    """Its colour."""


class Nodes:
    """Nodes that stay while they are shown: a new node takes the page longer than new values."""

    def __init__(self, scene: Any):
        """Show none yet."""
        self._scene = scene
        self._shown: dict[str, tuple[Any, dict[str, Any]]] = {}
        """Nodes and their values by name."""

    def show_lines(
        self, name: str, strands: Sequence[Strand], width: float, paint: Colour | None = None
    ) -> None:
        """Show strands of a width [px] as one node, all in a colour `paint` or each in its own."""
        if not strands:
            self.remove(name)
            return
        lines = [np.stack([one.line[:-1], one.line[1:]], axis=1) for one in strands]
        colours = to_linear(np.array([paint or one.colour for one in strands]))
        ends = colours.repeat([len(line) for line in lines], axis=0)[:, None].repeat(2, axis=1)
        points = np.concatenate(lines).astype(np.float32)
        values = {"points": points, "colors": ends, "thickness": width}
        self._show(self._scene.add_line_segments, name, thickness_units="screen", **values)

    def show_label(self, name: str, words: str, place: Floats, **values: Any) -> None:
        """Show words, perhaps of several lines, that stand on a place (3,) of the scene [m]."""
        values = {"anchor": "bottom-center", **values}
        self._show(self._scene.add_label, name, text=words, position=place, **values)

    def remove(self, group: str, but: Collection[str] = ()) -> None:
        """Remove a node, and those below its name but some of these."""
        for name in [*self._shown]:
            if f"{name}/".startswith(f"{group}/") and name not in but:
                self._shown.pop(name)[0].remove()

    def _show(self, add: Any, name: str, **values: Any) -> None:
        """Add a node with some values, or send those of the node of this name that differ."""
        node, before = self._shown.get(name, (None, values))
        if node is None:
            node = add(name, **values)
        for key, value in values.items():
            if not np.array_equal(value, before[key]):
                setattr(node, key, value)
        self._shown[name] = node, values
