# SPDX-License-Identifier: Apache-2.0
"""Refuses paths over never seen ground under the belly, as the settings say, and reports it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_planner.maps.unobserved_ground import ALLOW, REFUSE, ObservedGround


@dataclass(frozen=True, eq=False)
class UnobservedCheck:
    """Tells which paths lead over ground of one map that was never seen, and may not."""

    seen: ObservedGround | None = None
    """The seen part of the map; None if it is not known, then the rule is ALLOW."""
    rule: str = ALLOW
    """A value of the parameter blind_ground."""

    @property
    def kinds(self) -> NDArray[np.uint8] | None:
        """(ny, nx) what was seen of each cell; None if the rule does not ask."""
        return None if self.seen is None or self.rule == ALLOW else self.seen.kinds

    def find(self, rover: Rover, poses: NDArray[np.float64]) -> tuple[int, str] | None:
        """Return the first waypoint of a path (n, 3) whose ground the rule refuses, and why."""
        if self.seen is None or self.rule == ALLOW:
            return None
        share = self.seen.share(rover, poses)
        first = share.first_refused(self.rule)
        if first < 0:
            return None
        counted = share.unobserved_share - (0.0 if self.rule == REFUSE else share.footprint_share)
        return first, (
            f"ground under the belly that was never seen: {100.0 * counted:.1f} % of that along "
            f"the path {self._name_rule()}"
        )

    def refuses(self, rover: Rover, pieces: Sequence[NDArray[np.float64]]) -> NDArray[np.bool_]:
        """Return (k,) whether the rule refuses pieces of path, each of poses (n, 3)."""
        if self.seen is None or not pieces:
            return np.zeros(len(pieces), bool)
        below = self.seen.refused_below(rover, np.concatenate(pieces), self.rule)
        firsts = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
        return np.logical_or.reduceat(below, firsts)

    def describe(self) -> str:
        """Return why the rover may not stand at a pose that `refuses` refuses, in words."""
        return f"ground under the belly that was never seen {self._name_rule()}"

    def _name_rule(self) -> str:
        return f"(blind_ground is {self.rule})"


NONE_REFUSED = UnobservedCheck()
"""Allows all ground."""
