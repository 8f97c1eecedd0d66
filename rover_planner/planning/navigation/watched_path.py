# SPDX-License-Identifier: Apache-2.0
"""The path that is driven, and where on it the rover is."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_planner.angles import wrap
from rover_planner.planning.path_geometry import distance_along

USUAL_RADIUS = 0.1
"""Wheel radius of a rover for which the distances below are meant [m]; for others they are as much
larger as its wheels."""
LOOK_AHEAD = 2.0
"""Distance along the path beyond the last place in which the next one is looked for [m]."""
LOOK_BACK = 0.3
"""The same before the last place [m]: a measured pose may jump back."""
TURN_LENGTH = 0.3
"""Distance [m] that counts as much as one radian of heading, to tell places where the path
crosses itself or turns on the spot."""
AHEAD_WEIGHT, BEHIND_WEIGHT = 0.05, 0.3
"""Of two places that are as near, such as start and end of a path that comes back, the one less
far along the path counts; going back counts more than going on."""
MOST_AHEAD = 10.0
"""Distance along the path from which on places count as equally far [m]."""


@dataclass(frozen=True)
class Place:
    """Place of the rover on a path."""

    index: int
    """Index of the nearest waypoint."""
    offset: float
    """Distance from it [m]."""
    remaining: float
    """Length of the path beyond it [m]."""


@dataclass(frozen=True, eq=False)
class WatchedPath:
    """An accepted path."""

    poses: NDArray[np.float64]
    """(n, 3) x, y [m] and yaw [rad] of the waypoints, map frame."""
    hash: str = ""
    """`msg_adapters.identity.path_hash` of the path as it was sent."""

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """Distance (n,) of each waypoint from the start, along the path [m]."""
        return distance_along(self.poses)

    def find_place(
        self,
        pose: NDArray[np.float64],
        last: int | None = None,
        wheel_radius: float = USUAL_RADIUS,
    ) -> Place:
        """Return the waypoint that is nearest to a pose.

        Args:
            pose: (3,) x, y [m] and yaw [rad] of the body.
            last: Index of the waypoint found last; only those around it are looked at. None looks
                at all, for a rover that has yet to drive the path.
            wheel_radius: Wheel radius of the rover [m].
        """
        along, size = self.distances, wheel_radius / USUAL_RADIUS
        first, end = 0, len(self.poses)
        if last is not None:
            first = int(np.searchsorted(along, along[last] - size * LOOK_BACK))
            end = int(np.searchsorted(along, along[last] + size * LOOK_AHEAD, side="right"))
        away = np.hypot(*(self.poses[first:end, :2] - pose[:2]).T)
        turned = wrap(self.poses[first:end, 2] - pose[2])
        apart = np.hypot(away, size * TURN_LENGTH * turned)
        on = along[first:end] - along[0 if last is None else last]
        likely = (
            apart
            + AHEAD_WEIGHT * np.clip(on, 0.0, size * MOST_AHEAD)
            - BEHIND_WEIGHT * np.minimum(on, 0.0)
        )
        nearest = _descend(apart, int(np.argmin(likely)))
        index = first + nearest
        return Place(index, float(away[nearest]), float(along[-1] - along[index]))

    def is_end(self, index: int) -> bool:
        """Return whether a waypoint is the last one."""
        return index >= len(self.poses) - 1


def _descend(values: NDArray[np.float64], index: int) -> int:
    """Return the index (n,) of the local minimum that lies downhill of an index."""
    while True:
        low = max(0, index - 1)
        lowest = low + int(np.argmin(values[low : index + 2]))
        if values[lowest] >= values[index]:
            return index
        index = lowest
