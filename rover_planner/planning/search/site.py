# SPDX-License-Identifier: Apache-2.0
"""One rover on one map, with the options of its paths and what refuses them there."""

from dataclasses import dataclass, field

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.marked_places import NONE_MARKED, MarkedPlaces
from rover_planner.planning.path_query import Candidate, PathQueryOptions
from rover_planner.planning.search.unobserved_check import NONE_REFUSED, UnobservedCheck


@dataclass(frozen=True, eq=False)
class Site:
    """A rover on a map; options without lengths get those of the rover."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions = field(default_factory=PathQueryOptions)
    """Options of candidates and of the judgement of paths."""
    unobserved_check: UnobservedCheck = NONE_REFUSED
    """Refuses ground under the belly that was never seen."""
    marked: MarkedPlaces = NONE_MARKED
    """Places that are impassable."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", self.options.fit(self.rover))

    def hold(self, path: Candidate) -> Candidate:
        """Return a path, refused where its ground was never seen or is marked."""
        return self.marked.hold(self.unobserved_check.hold(self.rover, path))
