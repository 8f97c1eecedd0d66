# SPDX-License-Identifier: Apache-2.0
"""The layers of a terrain: one row each, from which files, messages and merged maps follow.

A new layer is one row of GRID_LAYERS, its check, and a field of `Terrain` of the same name.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rover_physics.terrain.checks import as_elevation_std, as_friction, as_ground_class

MOST_FREQUENT = "most frequent"


class GridLayer(NamedTuple):
    """One layer of a terrain, a value for each cell."""

    kind: type = np.float64
    """Type of its values."""
    unknown: float = np.nan
    """Value of a cell that has none."""
    combined: str = "max"
    """What counts of several values in a cell: "max", "min" or MOST_FREQUENT."""
    check: Callable[[Any, Any], Any] | None = None
    """Returns its checked values, given the checked elevation; None: `Terrain` has its own way."""
    field: str = ""
    """Its field in a cloud; empty if clouds have none."""
    is_smooth: bool = False
    """True if it is interpolated bilinearly between cells; else the nearest cell counts."""
    is_lasting: bool = False
    """True if values stay where a newer map has none."""

    @property
    def is_class(self) -> bool:
        """True if its values are names of classes, which a cloud may have in any datatype."""
        return self.combined == MOST_FREQUENT


GRID_LAYERS = {
    "elevation": GridLayer(is_smooth=True),
    "friction": GridLayer(combined="min", check=as_friction, field="friction", is_lasting=True),
    "elevation_std": GridLayer(check=as_elevation_std, field="elevation_std", is_smooth=True),
    "soil": GridLayer(np.int32, -1),
    "ground_class": GridLayer(
        combined=MOST_FREQUENT, check=as_ground_class, field="class", is_lasting=True
    ),
}
"""All layers by name; a fingerprint counts them in this order."""
