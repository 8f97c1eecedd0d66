# SPDX-License-Identifier: Apache-2.0
"""Maps that are read by windows: those kept in a store, and GeoTIFF files."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_planner.survey.layout import Box, Index

MAP = "map"
"""Group of a store that holds the map, where it comes from an .npz file."""
GRIDS = ("elevation", "friction", "soil", "elevation_std")
"""Layers of a map that predictions use, named as the fields of a Terrain."""
MAP_CHUNK = 512
"""Side of the chunks in which a map is kept [cells]."""

Grids = dict[str, np.ndarray]
"""Layers of a part of a map by name; row 0 at the smallest y."""


class MapFrame(NamedTuple):
    """Place and size of the cells of a map."""

    shape: Index
    """Rows and columns."""
    resolution: float
    """Cell size [m]."""
    origin: tuple[float, float]
    """x, y of the centre of cell [0, 0] [m]."""
    crs: str
    """Coordinate reference system as WKT, empty if unknown."""


@dataclass(frozen=True)
class StoredMap:
    """A map that is kept in the store of its survey."""

    group: Any
    """Group of the store that holds it."""

    @property
    def soil_names(self) -> tuple[str, ...]:
        """Names of the soils that the layer soil points to."""
        return tuple(self.group.attrs["soil_names"])

    def read(self, box: Box, every: int = 1) -> Grids:
        """Return the layers in a box of cells, every so many cells of them."""
        thin = tuple(slice(span.start, span.stop, every) for span in box)
        return {name: self.group[name][thin] for name in GRIDS if name in self.group}


def keep_map(group: Any, terrain: Terrain) -> None:
    """Write a terrain into a Zarr group, for `StoredMap`."""
    kept = group.create_group(MAP)
    for name in GRIDS:
        grid = getattr(terrain, name)
        if grid is not None:
            chunks = tuple(min(MAP_CHUNK, size) for size in grid.shape)
            kept.create_array(name, data=grid, chunks=chunks)
    kept.attrs["soil_names"] = list(terrain.soil_names)
