# SPDX-License-Identifier: Apache-2.0
"""Advice on a refused path: the remedies, best first, and whether all levers were tried."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import tightest_radius
from rover_planner.advice.case import Case, JudgedCase
from rover_planner.advice.seek import Remedy, seek_remedies
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.candidates import generate_candidates
from rover_planner.planning.path_geometry import distance_along

STOPPED = "the search was stopped before it found anything"
"""What is told of a search that nothing is known of."""
MOST_REMEDIES = 5
"""Largest number of remedies that are told."""
ENDS_APART = 0.5
"""Distance of two poses [wheelbases] from which they are start and goal, and no path."""

SAME_DISTANCE = 0.3
"""Distance [wheel radii] in whose times at nominal speed remedies are compared."""


@dataclass(frozen=True, eq=False)
class Advice:
    """The changes that would make a path pass."""

    judged: JudgedCase
    """The path as it was judged."""
    found: tuple[Remedy, ...] = ()
    """All remedies, best first."""
    tried: tuple[str, ...] = ()
    """Names of the levers that were tried last."""
    complete: bool = False
    """True if all levers were tried."""

    @property
    def remedies(self) -> tuple[Remedy, ...]:
        """The best remedies that options and path of `predict` hold."""
        return tuple(one for one in self.found if one.is_option)[:MOST_REMEDIES]

    @property
    def others(self) -> tuple[Remedy, ...]:
        """The best remedies that change the ground or the rover's limits."""
        return tuple(one for one in self.found if not one.is_option)[:MOST_REMEDIES]

    def describe(self) -> str:
        """Return the result in words."""
        if self.judged.passes:
            return "the path is traversable as it is"
        if any(not one.needs_others for one in self.found):
            return f"the first of {len(self.found)}: {self.found[0].describe()}"
        which = "no lever helps" if self.complete else "no lever that was tried in time helps"
        return f"{which} that the rover has" if self.found else which

    def to_dict(self) -> dict[str, Any]:
        """Return the advice as JSON types; see docs/advice.md."""
        verdict = self.judged.verdict
        return {
            "traversable": self.judged.passes,
            "code": verdict.code,
            "reason": verdict.reason,
            "first_failure": verdict.first_failure,
            "words": self.describe(),
            "remedies": [one.to_dict() for one in self.remedies],
            "others": [one.to_dict() for one in self.others],
            "complete": self.complete,
        }


def grow_advice(case: Case) -> Iterator[Advice]:
    """Yield advice that grows with each trial; the last one is complete unless it was stopped.

    Raises:
        QuestionStoppedError: Not even the path itself was judged; it says STOPPED.
        RoverError: The model refuses the path or an option.
    """
    advice = None
    try:
        judged = case.judge()
        advice = Advice(judged)
        if not judged.passes:
            yield advice
            for levers, remedy in seek_remedies(judged):
                found = advice.found if remedy is None else (*advice.found, remedy)
                tried = tuple(lever.name for lever in levers)
                advice = replace(advice, found=tuple(sorted(found, key=_rank)), tried=tried)
                yield advice
    except QuestionStoppedError as error:
        if advice is None:
            raise QuestionStoppedError(error.code, STOPPED) from error
        return
    yield replace(advice, complete=True)


def refuse(code: str, reason: str) -> dict[str, Any]:
    """Return the answer without advice as JSON types, with keys that advice has."""
    return {"code": code, "reason": reason, "remedies": [], "others": [], "complete": False}


def path_of(rover: Rover, poses: Floats, spacing: float) -> Floats:
    """Return poses (n, 3) as a path: two that are far apart are its start and goal."""
    if len(poses) != 2 or distance_along(poses)[-1] < ENDS_APART * rover.wheelbase:
        return np.asarray(poses)
    radius = tightest_radius(rover)
    return generate_candidates(*poses, count=1, waypoint_spacing=spacing, min_radius=radius)[0]


def _rank(remedy: Remedy) -> tuple[Any, ...]:
    """Return what sorts remedies: by whom, how many levers, time, and how close to a limit."""
    rover = remedy.judged.case.rover
    return (
        remedy.needs_others,
        len(remedy.levers),
        round(remedy.extra_time * rover.nominal_speed / (SAME_DISTANCE * rover.wheel.radius)),
        remedy.judged.largest_use[0],
    )
