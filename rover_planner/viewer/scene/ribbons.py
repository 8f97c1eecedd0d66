# SPDX-License-Identifier: Apache-2.0
"""Ribbons on the ground with halos, which stand out from a ground of any colour."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.scene.ground_mesh import as_unlit_glb
from rover_planner.viewer.state.colours import Colour, choose_halo

HALO = 0.2
"""Width of each halo on each side [widths of the ribbon]."""
PIXELS = 64
"""Pixels across a ribbon."""
LINE_WIDTH = 2.0
"""Width of the line along its middle [px], which is seen from any distance."""
LIFT = 0.05
"""Height of that line above the ribbon [widths of the ribbon]."""


@dataclass(frozen=True, eq=False)
class Strand:
    """A part of a ribbon: a line with a colour and a width."""

    line: Floats
    """(n, 3) points of its middle [m], frame of the scene, n >= 2."""
    colour: Colour
    """Its colour."""
    width: float
    """Width of the coloured stripe [m]."""

    def looks_like(self, other: "Strand") -> bool:
        """Return whether two strands are drawn the same."""
        same = self.colour == other.colour and self.width == other.width
        return same and np.array_equal(self.line, other.line)


class Ribbon:
    """Flat strands along lines: their colours in the middle, dark and light halos on both sides.

    The stripes lie side by side, so that none covers another. The colours are shown without light,
    as they are. All strands together are two nodes of the scene, which stay when they change: a
    new node takes the page longer than a new shape.
    """

    def __init__(self, scene: Any, name: str):
        """Draw nothing yet; the nodes will have names that begin with `name`."""
        self._scene, self.name = scene, name
        self.strands: tuple[Strand, ...] = ()
        """The drawn strands, in their own colours."""
        self._paint: Colour | None = None
        self._core: Any = None
        self._band: Any = None

    def show(self, strands: Sequence[Strand], paint: Colour | None = None) -> None:
        """Draw strands instead of what was drawn before; what looks the same is not sent again.

        Args:
            strands: The strands.
            paint: Colour of all of them (default: each in its own).
        """
        same = len(strands) == len(self.strands) and all(
            one.looks_like(other) for one, other in zip(strands, self.strands, strict=True)
        )
        if same and paint == self._paint:
            return
        self.strands, self._paint = tuple(strands), paint
        if strands:
            self._draw([one if paint is None else replace(one, colour=paint) for one in strands])
        else:
            self.remove()

    def paint(self, colour: Colour | None) -> None:
        """Show all strands in a colour, or each in its own again."""
        self.show(self.strands, colour)

    def remove(self) -> None:
        """Remove it."""
        if self._core is not None:
            self._core.remove()
            self._band.remove()
        self._core = self._band = None
        self.strands = ()

    def _draw(self, strands: Sequence[Strand]) -> None:
        glb = as_unlit_glb(make_ribbon(strands))
        points, colours = _line_segments(strands)
        if self._core is not None:
            self._band.glb_data = glb
            self._core.points, self._core.colors = points, colours
            return
        self._band = self._scene.add_glb(
            f"{self.name}-band", glb, cast_shadow=False, receive_shadow=False
        )
        self._core = self._scene.add_line_segments(
            self.name, points, colours, thickness=LINE_WIDTH, thickness_units="screen"
        )


def make_ribbon(strands: Sequence[Strand]) -> trimesh.Scene:
    """Return the bands of strands, those of one colour as one mesh."""
    scene = trimesh.Scene()
    for colour in dict.fromkeys(one.colour for one in strands):
        scene.add_geometry(_make_bands([one for one in strands if one.colour == colour]))
    return scene


def _make_bands(strands: Sequence[Strand]) -> trimesh.Trimesh:
    """Return the bands of strands of one colour as a mesh with a picture across."""
    from PIL import Image

    colour = strands[0].colour
    stripes = choose_halo(colour)
    halos = 1.0 + 2.0 * HALO * len(stripes)
    vertices = [_edges(one.line, 0.5 * one.width * halos) for one in strands]
    firsts = np.cumsum([0, *(len(part) for part in vertices)])
    faces = [
        first + _join_edges(len(one.line)) for first, one in zip(firsts[:-1], strands, strict=True)
    ]
    across = [np.repeat([0.0, 1.0], len(one.line)) for one in strands]
    uv = np.column_stack([np.concatenate(across), np.full(firsts[-1], 0.5)])
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(_stripe(colour, stripes)),
        metallicFactor=0.0,
        roughnessFactor=1.0,
    )
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return trimesh.Trimesh(
        np.concatenate(vertices), np.concatenate(faces), visual=visual, process=False
    )


def _line_segments(strands: Sequence[Strand]) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return segments (n, 2, 3) along the middles of strands [m], and their colours (n, 2, 3)."""
    points, colours = [], []
    for one in strands:
        above = one.line + np.array([0.0, 0.0, LIFT * one.width])
        points.append(np.stack([above[:-1], above[1:]], axis=1))
        colours.append(np.full((len(above) - 1, 2, 3), one.colour, np.uint8))
    return np.concatenate(points).astype(np.float32), np.concatenate(colours)


def _edges(line: Floats, half: float) -> Floats:
    """Return the points (2 n, 3) left and right of a line (n, 3), `half` the width away [m]."""
    ahead = np.gradient(line[:, :2], axis=0)
    lengths = np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-ahead[:, 1:] / lengths, ahead[:, :1] / lengths, np.zeros(len(line))])
    return np.concatenate([line + half * left, line - half * left])


def _join_edges(n: int) -> NDArray[np.intp]:
    """Return the triangles (m, 3) between `_edges` of n points, seen from above and below."""
    k = np.arange(n - 1)
    faces = np.concatenate(
        [np.column_stack([k, k + n, k + 1]), np.column_stack([k + 1, k + n, k + n + 1])]
    )
    return np.concatenate([faces, faces[:, ::-1]])


def _stripe(colour: Colour, halos: tuple[Colour, ...]) -> NDArray[np.uint8]:
    """Return the picture (1, PIXELS, 3) across a ribbon, halos from the outside in."""
    half = 0.5 + HALO * len(halos)
    away = np.abs(np.linspace(-half, half, PIXELS))
    picture = np.empty((1, PIXELS, 3), np.uint8)
    picture[:] = colour
    for k in reversed(range(len(halos))):
        picture[0, away >= half - HALO * (k + 1)] = halos[k]
    return picture
