# SPDX-License-Identifier: Apache-2.0
"""Layers on the ground: the area that is closed in, and where a search has asked the model."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.search.nodes import Nodes
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.viewer.scene.ground_mesh import join_cells, subsample
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, SEARCHED, UNKNOWN, Colour

CLOSED, ASKED = "/search/closed", "/search/asked"
"""Names of the layers in the scene."""
HEIGHTS = {CLOSED: 0.1, ASKED: 0.05}
"""Heights of the layers above the ground [wheel radii]."""
OPACITY = 0.5
"""Opacity of the layers."""


class SearchOverlay:
    """What a search for a way has found out about the ground."""

    def __init__(self, scene: Any, frame: LocalFrame | None = None):
        """Draw nothing yet; without a frame the scene is drawn in the map frame."""
        self._scene = scene
        self._frame = frame or LocalFrame()
        self._layers: dict[str, tuple[Any, Colour]] = {}
        """The layers by name, with their colours."""
        self._asked_shown = False

    def show(self, rover: Rover, terrain: Terrain, way: SearchResult | None) -> None:
        """Draw what a search has found instead of what was drawn before; None draws nothing.

        The closed area is blue around the start and vermillion around the goal.
        """
        for layer, _ in self._layers.values():
            layer.remove()
        self._layers.clear()
        if way is None:
            return
        if way.closed is not None:
            colour = REFUSED if way.closed.around_goal else PASSABLE
            self._draw(CLOSED, rover, terrain, (way.nodes, way.closed.places), colour)
        self._draw(ASKED, rover, terrain, (way.nodes, way.asked), SEARCHED)
        self.show_asked(self._asked_shown)

    def show_asked(self, visible: bool) -> None:
        """Show or hide where the model was asked."""
        self._asked_shown = visible
        if ASKED in self._layers:
            self._layers[ASKED][0].visible = visible

    def mark_old(self, is_old: bool) -> None:
        """Grey the layers if they are of old values."""
        for layer, colour in self._layers.values():
            wanted = UNKNOWN if is_old else colour
            if tuple(layer.color) != wanted:
                layer.color = wanted

    def _draw(
        self,
        name: str,
        rover: Rover,
        terrain: Terrain,
        where: tuple[Nodes, NDArray[np.bool_]],
        colour: Colour,
    ) -> None:
        """Draw places of nodes as a layer, if there are any on known ground."""
        vertices, faces = cover_places(terrain, *where)
        if not len(faces):
            return
        layer = self._scene.add_mesh_simple(
            name, self._frame.to_scene(vertices), faces, color=colour, opacity=OPACITY,
            flat_shading=False, side="double", cast_shadow=False, receive_shadow=False,
            position=(0.0, 0.0, HEIGHTS[name] * rover.wheel.radius),
        )  # fmt: skip
        self._layers[name] = layer, colour


def cover_places(
    terrain: Terrain, nodes: Nodes, places: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.intp]]:
    """Return vertices (n, 3) [m] and triangles (m, 3) of the drawn ground at places of nodes.

    Args:
        terrain: The ground.
        nodes: The nodes.
        places: (rows, columns) True for the places to cover.
    """
    x, y, heights = subsample(terrain)
    rows, columns = places.shape
    row = np.rint(y / nodes.cell).astype(int) - nodes.first[1]
    column = np.rint(x / nodes.cell).astype(int) - nodes.first[0]
    on_rows, on_columns = (row >= 0) & (row < rows), (column >= 0) & (column < columns)
    covered = np.zeros(heights.shape, bool)
    covered[np.ix_(on_rows, on_columns)] = places[np.ix_(row[on_rows], column[on_columns])]
    faces = join_cells(covered & np.isfinite(heights))
    used, faces = np.unique(faces, return_inverse=True)
    gx, gy = np.meshgrid(x, y)
    vertices = np.column_stack([gx.ravel(), gy.ravel(), heights.ravel()])[used]
    return vertices, faces.reshape(-1, 3)
