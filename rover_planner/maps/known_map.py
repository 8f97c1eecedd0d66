# SPDX-License-Identifier: Apache-2.0
"""The map that a traverse server knows: its terrain, where it comes from, and its age."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from msg_adapters.stamps import NANOSECONDS
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.layers import CellSources
from rover_planner.maps.unobserved_ground import ObservedGround, observed_ground


@dataclass(frozen=True, eq=False)
class KnownMap:
    """A valid map and when it came."""

    received: Terrain
    """The map as it was received."""
    terrain: Terrain
    """The map to plan on: small gaps are interpolated if so set."""
    source: str
    """Topic or file."""
    stamp: int | None
    """Stamp of the map's header [ns, ROS time]; None if it has none."""
    arrival: float
    """Time of arrival [s], steady clock."""
    cells: CellSources | None = None
    """Source and time of each cell; None: all known cells are from `source`."""

    @property
    def fingerprint(self) -> str:
        """The content of the received map, see `Terrain.fingerprint`."""
        return self.received.fingerprint

    @cached_property
    def seen(self) -> ObservedGround:
        """The seen part of the map, without interpolated gaps. Computed on first use."""
        return observed_ground(self.received, self.cells)

    @cached_property
    def coverage(self) -> float:
        """Share of the cells whose height is known, 0 to 1. Computed on first use."""
        return float(np.isfinite(self.terrain.elevation).mean())

    def describe(self, age: float) -> dict[str, Any]:
        """Return source, age [s], cells, cell size [m] and coverage [%] by name."""
        rows, columns = self.terrain.elevation.shape
        return {
            "map": self.source or "unnamed",
            "map age [s]": f"{age:.1f}",
            "map cells": f"{columns} x {rows}",
            "map resolution [m]": f"{self.terrain.resolution:g}",
            "map coverage [%]": f"{100.0 * self.coverage:.1f}",
        }

    def age(self, ros_time: int, steady_time: float) -> float:
        """Return the age [s]: the longer of the times since its stamp and since its arrival.

        Args:
            ros_time: Present ROS time [ns].
            steady_time: Present time of the steady clock [s].
        """
        since_arrival = steady_time - self.arrival
        if self.stamp is None:
            return since_arrival
        return max(since_arrival, (ros_time - self.stamp) / NANOSECONDS)

    def describe_age(self, ros_time: int, steady_time: float, max_age: float) -> str:
        """Return why the map is too old, or from the future; empty if it is neither.

        Args:
            ros_time: Present ROS time [ns].
            steady_time: Present time of the steady clock [s].
            max_age: Largest age, and largest lead of its stamp over the ROS time [s].
        """
        age = self.age(ros_time, steady_time)
        if age > max_age:
            return f"the map is {age:.1f} s old; max_map_age is {max_age:g} s"
        lead = 0.0 if self.stamp is None else (self.stamp - ros_time) / NANOSECONDS
        if lead > max_age:
            return f"the map's stamp is {lead:.1f} s in the future; check the clocks"
        return ""


def stamp_text(stamp: int | None) -> str:
    """Return a stamp [ns] as "seconds.nanoseconds", exact to the nanosecond; empty for None."""
    if stamp is None:
        return ""
    return f"{stamp // NANOSECONDS}.{stamp % NANOSECONDS:09d}"


def describe_terrain(terrain: Terrain) -> str:
    """Return cells, cell size [m] and known share, such as "480 x 480 cells of 0.05 m, ...".

    The share is rounded down to 0.1 %, so that 100 % means that every cell is known.
    """
    rows, columns = terrain.elevation.shape
    known = math.floor(1000.0 * np.isfinite(terrain.elevation).mean()) / 10.0
    return f"{columns} x {rows} cells of {terrain.resolution:g} m, {known:g} % known"
