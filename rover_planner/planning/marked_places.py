# SPDX-License-Identifier: Apache-2.0
"""Places that were marked as impassable, such as where the rover got stuck, with reason and date.

A place is a disc for the origin of the body. A rover may not come nearer to its centre there; it
may leave it, so that one that stands at its rim gets away.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_planner.errors import PlanningError

MARKED_CODE = "marked_place"
"""Code of the refusal."""
NEARER = 1e-6
"""Step towards a centre that counts [m]."""


@dataclass(frozen=True)
class MarkedPlace:
    """A disc that the origin of the body may not enter."""

    x: float
    y: float
    """Centre [m], map frame."""
    radius: float
    """Radius [m]."""
    reason: str
    """Reason why it is impassable."""
    date: str
    """When this was found."""

    def away(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances (n,) of poses (n, 3) from the centre [m]."""
        return np.hypot(poses[:, 0] - self.x, poses[:, 1] - self.y)

    def is_entered(
        self, before: NDArray[np.float64], after: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether steps lead nearer to the centre within the disc.

        Args:
            before: Distances from the centre where the steps begin [m].
            after: Distances (n,) where they end [m].
        """
        return (after < self.radius) & (after - before < -NEARER)

    def describe(self) -> str:
        """Return it in words."""
        return (
            f"{self.radius:.2f} m around {self.x:.2f}, {self.y:.2f} m are marked as impassable "
            f"since {self.date}: {self.reason}"
        )


@dataclass(frozen=True)
class MarkedPlaces:
    """All places that are marked."""

    places: tuple[MarkedPlace, ...]
    """The places."""

    def refuses(self, pieces: Sequence[NDArray[np.float64]]) -> NDArray[np.bool_]:
        """Return (k,) whether pieces of path, each of poses (n, 3), are refused."""
        if not self.places:
            return np.zeros(len(pieces), bool)
        return np.array([self.find(poses) is not None for poses in pieces], bool)

    def refuses_ends(
        self, start: NDArray[np.float64], ends: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether no path from a start (3,) may lead to ends (n, 3)."""
        refused = np.zeros(len(ends), bool)
        for place in self._near(ends):
            refused |= place.is_entered(place.away(start[None, :]), place.away(ends))
        return refused

    def find(self, poses: NDArray[np.float64]) -> tuple[int, MarkedPlace] | None:
        """Return the first pose that comes nearer to a centre within a disc, and its place."""
        firsts = []
        for place in self._near(poses):
            away = place.away(poses)
            enters = place.is_entered(away[:-1], away[1:])
            if enters.any():
                firsts.append((1 + int(np.argmax(enters)), place))
        return min(firsts, key=lambda first: first[0], default=None)

    def _near(self, poses: NDArray[np.float64]) -> list[MarkedPlace]:
        """Return the places, of perhaps thousands, whose discs reach the box around poses."""
        low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
        centres, radii = self._discs
        reached = (centres + radii >= low) & (centres - radii <= high)
        return [self.places[k] for k in np.flatnonzero(reached.all(axis=1)).tolist()]

    @cached_property
    def _discs(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centres (k, 2) and radii (k, 1) of the places [m]."""
        rows = np.array([(one.x, one.y, one.radius) for one in self.places]).reshape(-1, 3)
        return rows[:, :2], rows[:, 2:]


NONE_MARKED = MarkedPlaces(())
"""No places."""


def parse_place(text: str, source: str) -> MarkedPlace:
    """Read a place from JSON with x, y, radius, reason and date.

    Raises:
        PlanningError: It lacks one of them, or a value cannot be.
    """
    try:
        values = json.loads(text)
        x, y, radius = (float(values[name]) for name in ("x", "y", "radius"))
        place = MarkedPlace(x, y, radius, str(values["reason"]), str(values["date"]))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise PlanningError(
            f"{source}: is no place with x, y, radius, reason and date: {error}"
        ) from None
    if not (math.isfinite(x) and math.isfinite(y) and 0.0 < radius < math.inf):
        raise PlanningError(
            f"{source}: place is {x:g}, {y:g} m with radius {radius:g} m; all must be finite, and "
            "the radius above 0"
        )
    return place
