# SPDX-License-Identifier: Apache-2.0
"""Nodes of viser's scene by name, about an origin near the ground: shown, changed and removed."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.state.colours import Colour, to_linear

STEP = 1000.0
"""Distance of the origins to choose from, the first of which is that of the map frame [m].

A browser draws with 32-bit floats: at 1 km they are coarser than 0.06 mm, and at the coordinates
of a UTM map than 0.25 m.
"""


def find_origin(terrain: Terrain) -> Floats:
    """Return the origin (3,) of a scene [m] near the middle of a ground, at its median height."""
    x_low, x_high, y_low, y_high = terrain.bounds
    height = np.nanmedian(terrain.elevation)
    middle = np.array([0.5 * (x_low + x_high), 0.5 * (y_low + y_high), height])
    return np.asarray(STEP * np.round(middle / STEP))


@dataclass(frozen=True, eq=False)
class Strand:
    """A line of one colour."""

    line: Floats
    """(n, 3) its points [m], map frame; of fewer than two nothing is seen."""
    colour: Colour
    """Its colour."""


class Canvas:
    """Nodes that stay while they are shown: a new node takes the page longer than new values.

    The scene is the map frame moved to an origin near the ground: whatever has a place goes
    through `to_scene`.
    """

    terrain: Terrain
    """The ground, since `move_to`."""

    def __init__(self, scene: Any):
        """Show nothing yet."""
        self.scene = scene
        """The scene of viser."""
        self.origin: Floats = np.zeros(3)
        """(3,) origin of the scene [m], map frame."""
        self.radius = 0.0
        """Radius of the wheels of the rover that was drawn last [m]."""
        self.nodes: dict[str, Any] = {}
        """Nodes that are shown, by name."""

    def to_scene(self, points: ArrayLike) -> Floats:
        """Return points (..., 3) of the map frame in the scene [m]."""
        return np.asarray(points, dtype=float) - self.origin

    def move_to(self, terrain: Terrain) -> bool:
        """Take another ground, and the origin near it; return whether that moved.

        What was drawn before must then be drawn again.
        """
        before, self.origin, self.terrain = self.origin, find_origin(terrain), terrain
        return not np.array_equal(self.origin, before)

    def lay(self, points: ArrayLike, height: float, unknown: float = np.nan) -> Floats:
        """Return points (n, 3) at a height above the ground, map frame.

        Args:
            points: (n, 2) x and y [m].
            height: The height [wheel radii].
            unknown: Height of the ground where it is not known [m].
        """
        x, y = np.reshape(points, (-1, 2)).T
        ground = self.terrain.elevation_at(x, y)
        ground = np.where(np.isfinite(ground), ground, unknown)
        return np.column_stack([x, y, ground + height * self.radius])

    def show_lines(
        self, name: str, strands: Sequence[Strand], width: float, paint: Colour | None = None
    ) -> None:
        """Show strands of a width [px] as one node, all in a colour `paint` or each in its own."""
        strands = [one for one in strands if len(one.line) > 1]
        if not strands:
            self.remove(name)
            return
        lines = [np.stack([one.line[:-1], one.line[1:]], axis=1) for one in strands]
        colours = to_linear(np.array([paint or one.colour for one in strands]))
        ends = colours.repeat([len(line) for line in lines], axis=0)[:, None].repeat(2, axis=1)
        points = self.to_scene(np.concatenate(lines)).astype(np.float32)
        values = {"points": points, "colors": ends, "thickness": width}
        self.show(self.scene.add_line_segments, name, thickness_units="screen", **values)

    def show_label(self, name: str, words: str, place: Floats, **values: Any) -> None:
        """Show words, perhaps of several lines, that stand on a place (3,) [m], map frame."""
        values = {"anchor": "bottom-center", "position": self.to_scene(place), **values}
        self.show(self.scene.add_label, name, text=words, **values)

    def show_frame(self, name: str, **values: Any) -> None:
        """Show what is below a name where the values of viser's frames put it."""
        self.show(self.scene.add_frame, name, show_axes=False, **values)

    def show(self, add: Callable[..., Any], name: str, **values: Any) -> None:
        """Add a node with some values, or give them to the node of this name.

        viser sends those that differ.
        """
        if name in self.nodes:
            self.change(name, **values)
        else:
            self.nodes[name] = add(name, **values)

    def change(self, name: str, **values: Any) -> None:
        """Give values to a node."""
        for key, value in values.items():
            setattr(self.nodes[name], key, value)

    def remove(self, group: str, but: Collection[str] = ()) -> None:
        """Remove a node, and those below its name but some of these."""
        for name in reversed([*self.nodes]):  # what is below a node goes with it
            if f"{name}/".startswith(f"{group}/") and name not in but:
                self.nodes.pop(name).remove()
