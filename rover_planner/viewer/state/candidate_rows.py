# SPDX-License-Identifier: Apache-2.0
"""Candidate paths as rows of a table, and places for their numbers that do not overlap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.path_query import Candidate
from rover_planner.viewer.state.scenario import Shown

SHARES = np.linspace(0.2, 0.8, 13)
"""Shares of a path at which its number may stand."""
MAX_TRIED = 3
"""Rounds in which the places are improved."""


@dataclass(frozen=True, eq=False)
class CandidateRow:
    """One candidate path; the numbers of a refused one are up to its first failure."""

    number: int
    """Number of the path, from 1."""
    candidate: Candidate
    """The path and its verdict."""
    driven: float
    """Length up to the first failure [m]."""
    energy: float
    """Energy up to there, or to the last waypoint before at which the rover settles [J]."""
    is_best: bool
    """True if it is the one to drive, or that gets furthest."""
    is_old: bool
    """True if it was judged for other values than those that are wanted."""

    @property
    def verdict(self) -> Verdict:
        """The verdict on it."""
        return self.candidate.verdict


def list_candidates(shown: Shown, others_are_old: bool) -> tuple[CandidateRow, ...]:
    """Return the rows of all candidates.

    Args:
        shown: What is shown.
        others_are_old: True if the other candidates were judged for other values than are wanted.
    """
    rows = []
    for k, candidate in enumerate(shown.candidates):
        prediction = candidate.prediction
        last = min(candidate.verdict.first_failure, len(prediction.poses) - 1)
        rows.append(
            CandidateRow(
                number=k + 1,
                candidate=candidate,
                driven=float(prediction.distance[last]),
                energy=_last_known(prediction.energy[: last + 1 or None]),
                is_best=k == shown.answer.nearest,
                is_old=others_are_old and k != shown.index,
            )
        )
    return tuple(rows)


def _last_known(values: Floats) -> float:
    """Return the last of the values (n,) that is no NaN, 0 without one."""
    known = values[~np.isnan(values)]
    return float(known[-1]) if known.size else 0.0


def place_numbers(paths: Sequence[Floats], taken: Floats) -> Floats:
    """Return a place (k, 2) [m] for the number of each path, far from each other.

    Each number stands on its path, where the nearest of the other numbers and of the taken places
    is furthest.

    Args:
        paths: Points (n, 2) of each path [m].
        taken: Other places (j, 2) that are taken [m].
    """
    choices = [_points_at(path, SHARES) for path in paths]
    places = np.array([points[len(points) // 2] for points in choices]).reshape(-1, 2)
    for _ in range(MAX_TRIED):
        for k, points in enumerate(choices):
            others = np.concatenate([taken.reshape(-1, 2), np.delete(places, k, axis=0)])
            if len(others):
                away = np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1)
                places[k] = points[int(np.argmax(away))]
    return places


def _points_at(path: Floats, shares: Floats) -> Floats:
    """Return the points (k, 2) of a path (n, 2) at shares of its length."""
    steps = np.hypot(*np.diff(path, axis=0).T) if len(path) > 1 else np.zeros(0)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = shares * along[-1]
    return np.column_stack([np.interp(at, along, path[:, axis]) for axis in (0, 1)])
