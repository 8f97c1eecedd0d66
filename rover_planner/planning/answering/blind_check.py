"""Refuses paths over never seen ground under the belly, as the settings say, and reports it."""

from dataclasses import dataclass, replace

from rover_physics.rover.model import Rover
from rover_physics.traversability.verdict import with_refusals
from rover_planner.planning.path_planner import PathSearch
from rover_planner.planning.path_query import Candidate, choose
from rover_planner.planning.verdict_report import GroundReport
from rover_planner.worlds.maps.blind_ground import ALLOW, CODE, REFUSE, BlindShare, SeenGround

_REFUSED_COST = (float("inf"), float("inf"))


@dataclass(frozen=True, eq=False)
class BlindCheck:
    """Holds paths of one rover against what was seen of one map."""

    rover: Rover
    """The rover."""
    seen: SeenGround
    """What was seen of the map."""
    rule: str
    """One of BLIND_GROUND."""

    def report(self, candidate: Candidate) -> GroundReport:
        """Return how much of the ground under the belly was never seen along a path."""
        share = self._share(candidate)
        return GroundReport(share.blind_share, share.footprint_share)

    def hold(self, candidate: Candidate) -> Candidate:
        """Return a traversable path with a refusal where the rule refuses its ground."""
        if self.rule == ALLOW or not candidate.verdict.traversable:
            return candidate
        share = self._share(candidate)
        first = share.first_refused(self.rule)
        if first < 0:
            return candidate
        counted = share.blind_share - (0.0 if self.rule == REFUSE else share.footprint_share)
        codes, reasons = [""] * len(candidate.poses), [""] * len(candidate.poses)
        codes[first] = CODE
        reasons[first] = (
            f"ground under the belly that was never seen: {100.0 * counted:.1f} % of that along "
            f"the path (blind_ground is {self.rule})"
        )
        verdict = with_refusals(candidate.verdict, codes, reasons)
        return replace(candidate, verdict=verdict, cost=_REFUSED_COST)

    def choose(self, search: PathSearch) -> PathSearch:
        """Return a search whose choice is among the candidates that the rule does not refuse.

        If it refuses all that are traversable, the best of them is explained.
        """
        if self.rule == ALLOW or not search.answer.traversable:
            return search
        held = tuple(self.hold(candidate) for candidate in search.answer.candidates)
        answer = choose(held)
        if not answer.traversable:
            answer = replace(answer, nearest=search.answer.best)
        return replace(search, answer=answer)

    def _share(self, candidate: Candidate) -> BlindShare:
        return self.seen.share(self.rover, candidate.poses)


def physical(candidate: Candidate) -> Candidate:
    """Return a path as the model judged it, without a refusal by `BlindCheck.hold`."""
    if CODE not in candidate.verdict.codes:
        return candidate
    none = [""] * len(candidate.poses)
    return replace(candidate, verdict=with_refusals(candidate.verdict, none, none))
