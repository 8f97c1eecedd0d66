# SPDX-License-Identifier: Apache-2.0
"""The layers of a living map's window: grown, moved and written without touching earlier ones."""

from dataclasses import dataclass, replace

import numpy as np

from rover_planner.worlds.maps.cells import CellBox, Layer, Patch
from rover_planner.worlds.maps.sources import UNKNOWN

EMPTY = {
    "elevation": (np.float64, np.nan),
    "elevation_std": (np.float64, np.nan),
    "friction": (np.float64, np.nan),
    "soil": (np.int32, -1),
    "source": (np.uint8, UNKNOWN),
    "time": (np.float64, -np.inf),
}
"""Type and empty value of each layer."""
ALWAYS = ("elevation", "source", "time")
"""Layers that every window has."""


@dataclass(frozen=True, eq=False)
class Window:
    """Layers of a box of cells. The arrays are never written to: changes make a new window."""

    box: CellBox
    """The cells."""
    layers: dict[str, Layer]
    """(rows, columns) by name, those of ALWAYS and others of EMPTY."""

    def moved_to(self, box: CellBox) -> "Window":
        """Return the layers over another box; cells that this window lacks are empty."""
        if box == self.box:
            return self
        moved = empty_window(box, tuple(self.layers))
        to, source = self.box.within(box), box.within(self.box)
        for name, layer in self.layers.items():
            moved.layers[name][to] = layer[source]
        return moved

    def with_layers(self, names: tuple[str, ...]) -> "Window":
        """Return a window that has these layers too; heights that were exact stay so."""
        missing = tuple(name for name in names if name not in self.layers)
        if not missing:
            return self
        layers = self.layers | empty_window(self.box, missing).layers
        if "elevation_std" in missing:
            layers["elevation_std"] = np.where(np.isnan(layers["elevation"]), np.nan, 0.0)
        return replace(self, layers=layers)

    def written(self, patch: Patch, take: Layer, source: int, time: float) -> "Window":
        """Return a window in which a patch replaces some cells.

        Friction and soil that the patch does not have stay.

        Args:
            patch: The new values, of any box.
            take: (rows, columns) of the part of the patch within this window: True for the cells
                that it replaces.
            source: Their new source.
            time: Their new time [s].
        """
        names = tuple(name for name in patch.layers if name in EMPTY)
        old = self.with_layers(names)
        to, own = patch.box.within(old.box), old.box.within(patch.box)
        layers = {name: layer.copy() for name, layer in old.layers.items()}
        for name, layer in layers.items():
            if name == "source":
                layer[to][take] = source
            elif name == "time":
                layer[to][take] = time
            elif name == "friction" and name in patch.layers:
                values = patch.layers[name][own]
                known = take & np.isfinite(values)
                layer[to][known] = values[known]
            elif name in patch.layers:
                layer[to][take] = patch.layers[name][own][take]
            elif name == "elevation_std":
                layer[to][take] = 0.0
        return replace(old, layers=layers)


def empty_window(box: CellBox, names: tuple[str, ...] = ALWAYS) -> Window:
    """Return a window without known cells."""
    shape = box.rows, box.columns
    layers = {name: np.full(shape, EMPTY[name][1], EMPTY[name][0]) for name in names}
    return Window(box, layers)
