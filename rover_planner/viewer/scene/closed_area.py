# SPDX-License-Identifier: Apache-2.0
"""A layer on the ground: the area in which the rover, or from which the goal, is closed in."""

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
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN

HEIGHT = 0.1
"""Height of the layer above the ground [wheel radii]."""
OPACITY = 0.5
"""Opacity of the layer."""


class ClosedAreaOverlay:
    """The area that a search found closed in: blue about the start, vermillion about the goal."""

    def __init__(self, scene: Any, frame: LocalFrame):
        """Draw nothing yet."""
        self._scene, self._frame = scene, frame
        self.layer: Any = None
        """The layer's node; None if nothing is drawn."""
        self._colour = UNKNOWN

    def show(self, rover: Rover, terrain: Terrain, around: SearchResult | None) -> None:
        """Draw the area that a search found instead of what was drawn; None draws nothing."""
        if self.layer is not None:
            self.layer.remove()
            self.layer = None
        if around is None or around.closed is None:
            return
        vertices, faces = cover_places(terrain, around.nodes, around.closed.places)
        if len(faces):
            self._colour = REFUSED if around.closed.around_goal else PASSABLE
            self.layer = self._scene.add_mesh_simple(
                "/closed", self._frame.to_scene(vertices), faces, color=self._colour,
                opacity=OPACITY, flat_shading=False, side="double", cast_shadow=False,
                receive_shadow=False, position=(0.0, 0.0, HEIGHT * rover.wheel.radius),
            )  # fmt: skip

    def mark_old(self, is_old: bool) -> None:
        """Grey the layer if it is of old values."""
        if self.layer is not None:
            self.layer.color = UNKNOWN if is_old else self._colour


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
    used, faces = np.unique(join_cells(covered & np.isfinite(heights)), return_inverse=True)
    gx, gy = np.meshgrid(x, y)
    vertices = np.column_stack([gx.ravel(), gy.ravel(), heights.ravel()])[used]
    return vertices, faces.reshape(-1, 3)
