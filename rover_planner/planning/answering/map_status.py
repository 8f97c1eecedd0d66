# SPDX-License-Identifier: Apache-2.0
"""What diagnostics tell of the map: its source, age, size and coverage."""

from typing import Any

import numpy as np

from rover_planner.maps.known_map import KnownMap
from rover_planner.planning.answering.situation import Situation


class MapStatus:
    """Describes the map of a server; coverage is counted once for each map."""

    def __init__(self) -> None:
        self._counted: KnownMap | None = None
        self._coverage = 0.0

    def describe(self, situation: Situation) -> dict[str, Any]:
        """Return values by name: source, age [s], cells, cell size [m], known cells [%]."""
        known = situation.known_map
        if known is None:
            return {"map": "none"}
        if self._counted is None or self._counted.terrain is not known.terrain:
            self._coverage = 100.0 * float(np.isfinite(known.terrain.elevation).mean())
        self._counted = known
        rows, columns = known.terrain.elevation.shape
        return {
            "map": known.source or "unnamed",
            "map age [s]": f"{situation.map_age:.1f}",
            "map cells": f"{columns} x {rows}",
            "map resolution [m]": f"{known.terrain.resolution:g}",
            "map coverage [%]": f"{self._coverage:.1f}",
        }
