# SPDX-License-Identifier: Apache-2.0
"""One rover on one map, with the options of its paths and what refuses them there."""

from dataclasses import dataclass, field

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.unobserved_ground import ALLOW, REFUSE, UNOBSERVED_CODE, ObservedGround
from rover_planner.planning.assumptions import assume
from rover_planner.planning.marked_places import MARKED_CODE, NONE_MARKED, MarkedPlaces
from rover_planner.planning.path_query import Candidate, PathQueryOptions


@dataclass(frozen=True, eq=False)
class Site:
    """A rover on a map; options without lengths get those of the rover."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions = field(default_factory=PathQueryOptions)
    """Options of candidates and of the judgement of paths."""
    seen: ObservedGround | None = None
    """The seen part of the map; None if it is not known."""
    blind_ground: str = ALLOW
    """What of the ground under the belly that was never seen is refused: a value of the parameter
    blind_ground."""
    marked: MarkedPlaces = NONE_MARKED
    """Places that are impassable."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", self.options.fit(self.rover))

    @property
    def assumed_rover(self) -> Rover:
        """The rover with friction, torque and payload of the options in place of its own."""
        return assume(self.rover, self.options.model).change(self.rover)

    @property
    def checked_ground(self) -> ObservedGround | None:
        """The seen part of the map if ground that was never seen may be refused; else None."""
        return None if self.blind_ground == ALLOW else self.seen

    def explain_unseen(self, detail: str = "") -> str:
        """Return why ground that was never seen is refused, in words, with a detail."""
        rule = f"(blind_ground is {self.blind_ground})"
        return f"ground under the belly that was never seen{detail} {rule}"

    def refuse_ground(self, path: Candidate) -> Candidate:
        """Return a path as the model judged it, refused where its ground is unseen or marked."""
        if not path.verdict.traversable:
            return path
        if self.checked_ground is not None:
            share = self.checked_ground.share(self.rover, path.poses)
            first, counted = share.first_refused(self.blind_ground), share.unobserved_share
            if first >= 0:
                counted -= 0.0 if self.blind_ground == REFUSE else share.footprint_share
                detail = f": {100.0 * counted:.1f} % of that along the path"
                return path.refuse_at(first, UNOBSERVED_CODE, self.explain_unseen(detail))
        entered = self.marked.find(path.poses)
        if entered is not None:
            return path.refuse_at(entered[0], MARKED_CODE, entered[1].describe())
        return path
