# SPDX-License-Identifier: Apache-2.0
"""One rover on one map, with the options of its paths and what refuses them there."""

from dataclasses import dataclass, field

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.unobserved_ground import UNOBSERVED_CODE
from rover_planner.planning.assumptions import assume
from rover_planner.planning.marked_places import MARKED_CODE, NONE_MARKED, MarkedPlaces
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

    @property
    def assumed_rover(self) -> Rover:
        """The rover with friction, torque and payload of the options in place of its own."""
        return assume(self.rover, self.options.model).change(self.rover)

    def refuse_ground(self, path: Candidate) -> Candidate:
        """Return a path as the model judged it, refused where its ground is unseen or marked."""
        if not path.verdict.traversable:
            return path
        unseen = self.unobserved_check.find(self.rover, path.poses)
        if unseen is not None:
            return path.refuse_at(unseen[0], UNOBSERVED_CODE, unseen[1])
        entered = self.marked.find(path.poses)
        if entered is not None:
            return path.refuse_at(entered[0], MARKED_CODE, entered[1].describe())
        return path
