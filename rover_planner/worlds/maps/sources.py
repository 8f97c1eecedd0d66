# SPDX-License-Identifier: Apache-2.0
"""What each cell of a map is known from, and since when."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

UNKNOWN, LOADED, CONTACT, FOOTPRINT = range(4)
"""Sources of cells: none, a loaded map, a wheel that stands there, and the ground assumed between
and around the wheels. Higher numbers are topics."""
FIRST_NAMES = ("unknown", "loaded", "contact", "footprint")
"""Their names."""


@dataclass(frozen=True, eq=False)
class CellSources:
    """Source and time of each cell of a map."""

    source: NDArray[np.uint8]
    """(ny, nx) indices into `names`."""
    time: NDArray[np.float64]
    """(ny, nx) stamp of the map or measurement [s, ROS time]; -inf where unknown."""
    names: tuple[str, ...] = FIRST_NAMES
    """Names of the sources: FIRST_NAMES, then topics."""

    def count(self) -> dict[str, int]:
        """Return the number of cells of each source, by name."""
        counts = np.bincount(self.source.ravel(), minlength=len(self.names))
        return dict(zip(self.names, counts.tolist(), strict=True))
