# SPDX-License-Identifier: Apache-2.0
"""Why a judged path can be driven or not: its limits, its failure, and the worst so far."""

from dataclasses import dataclass

from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.state.reasons.failure import Failure, find_failure
from rover_planner.viewer.state.reasons.path_limits import PathLimits, find_path_limits
from rover_planner.viewer.state.scenario import Judgement


@dataclass(frozen=True, eq=False)
class Explanation:
    """The limits along a path and its first failure."""

    limits: PathLimits
    """How it uses the limits, up to the first failure."""
    failure: Failure | None
    """The first failure; None if the path can be driven."""

    @property
    def failure_at(self) -> float | None:
        """Distance of the failure [m]; None without one."""
        return None if self.failure is None else self.failure.distance

    @property
    def failing_link(self) -> str:
        """The link that fails; empty for none."""
        return "" if self.failure is None else self.failure.link


def explain(judgement: Judgement) -> Explanation:
    """Return the explanation of the shown path of a judgement."""
    asked, shown = judgement.scenario, judgement.shown
    terrain: Terrain = asked.terrain
    prediction, verdict = shown.candidate.prediction, shown.verdict
    limits = find_path_limits(asked.rover, prediction, verdict)
    failure = find_failure(asked.rover, terrain, prediction, verdict, limits)
    return Explanation(limits, failure)
