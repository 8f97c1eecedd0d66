# SPDX-License-Identifier: Apache-2.0
"""Asks the model about pieces of path and about single nodes, and counts the work."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_poses
from rover_physics.traversability.pieces import judge_pieces
from rover_physics.traversability.verdict import Verdict
from rover_planner.maps.unobserved_ground import CODE
from rover_planner.planning.lattice.blind_check import BlindCheck
from rover_planner.planning.lattice.costs import true_cost
from rover_planner.planning.lattice.primitives import Gear
from rover_planner.planning.path_query import Candidate, PathQueryOptions, check_path


@dataclass(frozen=True)
class Judged:
    """What the model found of a piece of path."""

    code: str
    """Code of the limit that fails first, empty if the rover may drive it."""
    cost: float
    """Its cost [m], infinite if it fails."""


@dataclass
class Judge:
    """The model of one rover on one map with options."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions
    """How paths are judged."""
    blind: BlindCheck | None = None
    """Refuses ground under the belly that was never seen; None allows it."""
    poses: int = field(default=0, init=False)
    """Number of poses asked for so far, a measure of the work done."""

    def judge(self, pieces: Sequence[NDArray[np.float64]], gears: Sequence[Gear]) -> list[Judged]:
        """Judge pieces of path, each of poses (n, 3).

        Ways out of pits are not asked for; that is done for the whole path.
        """
        self.poses += sum(map(len, pieces))
        found = judge_pieces(
            self.rover,
            self.terrain,
            pieces,
            self.options.model,
            sigmas=self.options.map_sigmas,
        )
        judged = [
            Judged(piece.code, true_cost(self.rover, gear, piece))
            for gear, piece in zip(gears, found, strict=True)
        ]
        for row in self._find_blind(pieces, [one.code for one in judged]):
            judged[row] = Judged(CODE, math.inf)
        return judged

    def stand(self, poses: NDArray[np.float64]) -> tuple[str, ...]:
        """Return the codes (n,) of what fails at single poses (n, 3), wheels ahead; "" if none."""
        codes = list(self._stand(poses).codes)
        if self.blind is None:
            return tuple(codes)
        for row in self._find_blind([pose[None, :] for pose in poses], codes):
            codes[row] = CODE
        return tuple(codes)

    def _find_blind(
        self, pieces: Sequence[NDArray[np.float64]], codes: Sequence[str]
    ) -> Iterator[int]:
        """Yield the indices of pieces that pass by their codes, but are over blind ground."""
        passing = [row for row, code in enumerate(codes) if not code]
        if self.blind is None or not passing:
            return
        refused = self.blind.refuses([pieces[row] for row in passing])
        for row in np.flatnonzero(refused).tolist():
            yield passing[row]

    def _stand(self, poses: NDArray[np.float64]) -> Verdict:
        """Judge single poses (n, 3), wheels ahead."""
        self.poses += len(poses)
        return judge_poses(
            self.rover,
            self.terrain,
            poses,
            np.zeros(len(poses)),
            self.options.model,
            sigmas=self.options.map_sigmas,
        )[1]

    def refuse(self, pose: NDArray[np.float64]) -> tuple[str, str]:
        """Return code and reason why the rover cannot stand at a pose (3,), empty if it can."""
        verdict = self._stand(pose[None, :])
        if not verdict.codes[0] and self.blind is not None and self.blind.refuses([pose[None]])[0]:
            return CODE, self.blind.describe()
        return verdict.codes[0], verdict.reasons[0]

    def check(self, poses: NDArray[np.float64]) -> Candidate:
        """Judge a whole path (n, 3) with all that belongs to it, up to its first failure."""
        self.poses += len(poses)
        checked = check_path(
            self.rover,
            self.terrain,
            poses,
            self.options,
            stop_at_failure=True,
        )
        return checked if self.blind is None else self.blind.hold(checked)
