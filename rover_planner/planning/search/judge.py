# SPDX-License-Identifier: Apache-2.0
"""The model of one rover on one map: judges paths, pieces of path and single poses.

What a piece of path costs, in metres of level ground, is made of time, energy and risk:

    cost = gear price x time x nominal speed
         + CLIMB x energy / weight
         + RISK x exposure x nominal speed

Energy over weight is the height [m] to which the energy would lift the rover. The exposure [s] is
the time at the limits: each moment counts by the square of ((used share of the tightest safety
limit) - 1/2) x 2, which is 0 up to half of a limit and 1 at it.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import islice
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.bounds.path import is_uncertain
from rover_physics.limits.table import CHANCE
from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.uses import find_codes
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import ClassifiedWaypoint, classify_judged
from rover_physics.traversability.judge import judge_path, judge_paths, judge_poses
from rover_physics.traversability.pieces import PieceVerdict, find_exposure, judge_pieces
from rover_physics.traversability.verdict import Verdict, with_refusals
from rover_planner.maps.unobserved_ground import UNOBSERVED_CODE
from rover_planner.planning.marked_places import MARKED_CODE
from rover_planner.planning.path_geometry import rings_within
from rover_planner.planning.path_query import (
    Candidate,
    PathAnswer,
    Pose,
    choose,
    generate_paths,
)
from rover_planner.planning.search.edges import PRICES, Gear, Piece
from rover_planner.planning.search.query import Site

CLIMB = 2.0
"""Metres of level ground that cost as much as the energy that lifts the rover by one metre."""
RISK = 2.0
"""Further cost of a metre at the limit, in metres of level ground."""
FIRST_LOOK = 0.4 + 1e-6
"""Distance of waypoints [wheel radii] at which several candidates are compared: 2 of 754 random
paths get another verdict than at dense ones, and a question takes 0.8 of the time."""
LEAST_CHANCE, LEAST_SHARE = 0.001, 0.3
"""Least accepted chance, and share of friction and torque limit, for which pieces are judged."""
BACK = (0.0, True)
"""Curvature [1/m] of a rover that drives straight back, and that it drives backwards."""
OTHER_MOTIONS = (BACK, (math.inf, False), (-math.inf, False))
"""All motions but straight ahead: back, and turns on the spot."""
_QUERIES_PER_RING = 4
"""Other goals on a ring around the goal that are tried at most."""


class JudgedPiece(NamedTuple):
    """Code and cost of a piece of path."""

    code: str
    """Code of the limit that fails first, empty if the rover may drive it."""
    cost: float
    """Its cost [m], infinite if it fails."""


@dataclass
class PathJudge:
    """The model of a rover on a map."""

    site: Site
    """Rover, map and options."""
    known: KnownPoses | None = None
    """Results of the model along whole paths so far, None if that is not kept."""
    known_in_pieces: KnownPoses | None = None
    """The same along pieces, with the friction and torque limit for which they are judged."""
    asked_poses: int = field(default=0, init=False)
    """Number of poses that searches have asked for so far, a measure of the work done."""

    def search(self, start: ArrayLike, goal: ArrayLike, tolerance: float = 0.0) -> PathAnswer:
        """Find a path from start to goal, or to a goal near it, among candidate paths.

        Args:
            start: Start of the path.
            goal: End of the path.
            tolerance: Largest distance from the goal's position [m] at which the path may end
                if the goal cannot be reached; the heading stays. 0 tries the goal only.

        Returns:
            The answer for the goal, or for the first alternative goal that can be reached.

        Raises:
            PlanningError: Start, goal or options are invalid.
            RoverError: The model refuses an option or the poses.
        """
        start, goal = np.asarray(start, float), np.asarray(goal, float)
        answer, end, tried = self._answer(start, goal), goal, 0
        if not answer.traversable and self._fails_at(answer, goal, tolerance):
            rings = self.goals_near(start, goal, tolerance)
            for alternative in (one for ring in rings for one in islice(ring, _QUERIES_PER_RING)):
                tried += 1
                other = self._answer(start, alternative)
                if other.traversable:
                    answer, end = other, alternative
                    break
        offset = float(np.hypot(*(end - goal)[:2]))
        return replace(answer, goal=end, goal_offset=offset, alternatives_tried=tried)

    def _answer(self, start: Pose, goal: Pose) -> PathAnswer:
        """Judge the candidate paths to a goal and choose the best one that passes.

        Of several, a first look at some waypoints of each tells which one to choose. That one is
        judged at all its waypoints, with entrapment and its chance of failure, until the one to
        choose has been. Refused ones are judged up to their first failure. If the ground of all
        that pass is refused, the best of them is explained.
        """
        paths = generate_paths(self.site.rover, start, goal, self.site.options)
        if len(paths) == 1:
            is_on_map = self.site.terrain.contains(*paths[0][-1, :2])
            return choose((self.check(paths[0], stop_at_failure=not is_on_map),))
        candidates = self._look_at(paths)
        closely, passing = list[int](), list[int]()
        while (k := choose(tuple(candidates)).choice) not in closely:
            judged = self._judge_path(paths[k], stop_at_failure=True)
            candidates[k] = self.site.refuse_ground(judged)
            closely.append(k)
            passing += [k] if judged.verdict.traversable else []
        if passing and not candidates[k].verdict.traversable:
            k = passing[0]
        if candidates[k].verdict.code == CHANCE:
            candidates[k] = self.check(paths[k])
        return PathAnswer(tuple(map(self.site.refuse_ground, candidates)), k)

    def _look_at(self, paths: list[NDArray[np.float64]]) -> list[Candidate]:
        """Judge paths at waypoints FIRST_LOOK apart, up to the first failure of each."""
        site = self.site
        looked = int(FIRST_LOOK * site.rover.wheel.radius / site.options.waypoint_spacing)
        looks = [np.concatenate([one[: -1 : max(looked, 1)], one[-1:]]) for one in paths]
        judged = judge_paths(
            site.rover,
            site.terrain,
            looks,
            site.options.model,
            sigmas=site.options.map_sigmas,
            stop_at_failure=True,
            check_entrapment=False,
        )
        return [Candidate(poses, *one) for poses, one in zip(looks, judged, strict=True)]

    def _fails_at(self, answer: PathAnswer, goal: Pose, tolerance: float) -> bool:
        """Return whether another goal within `tolerance` [m] may help.

        It may if some path fails where the ground under the rover is also ground under a rover
        at an allowed goal. Other paths fail before, where paths to the other goals lead too.
        """
        near = tolerance + self.site.rover.wheelbase
        failures = [
            one.poses[one.verdict.first_failure] - goal
            for one in answer.candidates
            if one.verdict.first_failure > 0
        ]
        return any(np.hypot(*failure[:2]) <= near for failure in failures)

    def goals_near(self, start: Pose, goal: Pose, tolerance: float) -> Iterator[Iterator[Pose]]:
        """Yield rings of alternative goals where the rover can stand, from near to far.

        Goals on the start's side of a ring come first. If these cannot be reached, those behind
        them rarely can.
        """
        for ring in rings_within(start, goal, tolerance, self.site.rover.wheel.radius):
            reached = np.array(ring)[~self.site.marked.refuses_ends(start, np.array(ring))]
            judged = map(self._judge_path, reached[:, None, :])
            allowed = zip(reached, map(self.site.refuse_ground, judged), strict=True)
            yield (pose for pose, path in allowed if path.verdict.traversable)

    def check(self, poses: NDArray[np.float64], *, stop_at_failure: bool = False) -> Candidate:
        """Judge one given path of poses (n, 3).

        With `stop_at_failure`, the waypoints beyond the first failure are left out, and a chance
        of failure above the accepted one may be larger than is said. The chance is asked for only
        where the path passes without it.

        Raises:
            RoverError: The model refuses an option or the poses.
        """
        self.asked_poses += len(poses)
        return self.site.refuse_ground(self._judge_path(poses, stop_at_failure=stop_at_failure))

    def _judge_path(
        self, poses: NDArray[np.float64], *, stop_at_failure: bool = False
    ) -> Candidate:
        """Judge a path as `check`, on whatever ground."""
        site = self.site
        judged = judge_path(
            site.rover,
            site.terrain,
            poses,
            site.options.model,
            sigmas=site.options.map_sigmas,
            stop_at_failure=stop_at_failure,
            accepted_chance=site.options.asked_chance,
            chance_of_refused=False,
            known=self.known,
        )
        return Candidate(poses, *judged)

    def classify(self, candidate: Candidate) -> tuple[ClassifiedWaypoint, ...]:
        """Return the class of each waypoint of a judged path; may evaluate the path once more."""
        site, verdict = self.site, candidate.verdict
        if {UNOBSERVED_CODE, MARKED_CODE} & set(verdict.codes):  # which the model passes
            none = [""] * len(verdict.codes)
            verdict = with_refusals(verdict, none, none)
        return classify_judged(
            site.rover,
            site.terrain,
            candidate.prediction,
            verdict,
            site.options.model,
            sigmas=site.options.map_sigmas,
        )

    @cached_property
    def _cautious(self) -> tuple[Terrain, SweepOptions]:
        """Ground and options for pieces of path, such that their chance is accepted.

        With the friction and the torque limit below which they are with the accepted chance,
        pieces need no samples; the whole path gets them.
        """
        terrain, rover = self.site.terrain, self.site.assumed_rover
        accepted, model = self.site.options.asked_chance, self.site.options.model
        if accepted is None:
            return terrain, model
        low = min(NormalDist().inv_cdf(max(accepted, LEAST_CHANCE)), 0.0)
        off = rover.uncertainty
        friction, torque = (
            max(1.0 + low * math.hypot(std, off.model), LEAST_SHARE)
            for std in (off.friction, off.max_torque)
        )
        return _weaken(terrain, friction), replace(
            model,
            friction=friction * rover.friction,
            max_torque=torque * rover.wheel.max_torque,
        )

    def judge_pieces(self, pieces: Sequence[Piece]) -> list[JudgedPiece]:
        """Judge pieces of path; whether a path ends in a pit is asked of whole paths only."""
        site = self.site
        poses = [piece.poses for piece in pieces]
        self.asked_poses += sum(map(len, poses))
        (terrain, model), sigmas = self._cautious, site.options.map_sigmas
        found = judge_pieces(
            site.rover, terrain, poses, model, sigmas=sigmas, known=self.known_in_pieces
        )
        judged = [
            JudgedPiece(verdict.code, find_cost(site.rover, piece.gear, verdict))
            for piece, verdict in zip(pieces, found, strict=True)
        ]
        for row in self._find_unobserved(poses, [one.code for one in judged]):
            judged[row] = JudgedPiece(UNOBSERVED_CODE, math.inf)
        for row in np.flatnonzero(site.marked.refuses(poses)).tolist():
            judged[row] = JudgedPiece(MARKED_CODE, math.inf)
        return judged

    def stand(self, poses: NDArray[np.float64]) -> tuple[str, ...]:
        """Return the codes (n,) of what fails at single poses (n, 3), wheels ahead; "" if none.

        A rover that slips ahead up a slope of sand stands there if it can back out.
        """
        site = self.site
        if not is_uncertain(site.terrain, site.options.map_sigmas):
            self.asked_poses += len(poses)
            model = pack_model(site.rover, site.terrain, site.options.model)
            codes = find_codes(model.limits, model.evaluate(poses))
        else:
            codes = list(self._judge_standing(poses).codes)
        if site.terrain.soil is not None or site.options.model.soil is not None:
            refused = np.flatnonzero([code != "" for code in codes])
            for row in refused[self._stand_otherwise(poses[refused], BACK)].tolist():
                codes[row] = ""
        for row in self._find_unobserved(poses[:, None, :], codes):
            codes[row] = UNOBSERVED_CODE
        return tuple(codes)

    def refuse(self, start: Pose, pose: Pose) -> tuple[str, str]:
        """Return code and reason why a path from a start cannot end at a pose, empty if it can."""
        site = self.site
        verdict = self._judge_standing(pose[None, :])
        code, reason = verdict.codes[0], verdict.reasons[0]
        if code and self._stand_otherwise(pose[None, :], *OTHER_MOTIONS)[0]:
            code, reason = "", ""
        if self._find_unobserved([pose[None, :]], [code]):
            return UNOBSERVED_CODE, site.explain_unseen()
        entered = None if code else site.marked.find(np.stack([start, pose]))
        return (code, reason) if entered is None else (MARKED_CODE, entered[1].describe())

    def _stand_otherwise(
        self, poses: NDArray[np.float64], *motions: tuple[float, bool]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether the rover stands at poses (n, 3) in any of some motions."""
        stands = np.zeros(len(poses), bool)
        for motion in motions:
            rows = np.flatnonzero(~stands)
            if len(rows):
                codes = self._judge_standing(poses[rows], *motion).codes
                stands[rows] = [code == "" for code in codes]
        return stands

    def _judge_standing(
        self, poses: NDArray[np.float64], curvature: float = 0.0, backward: bool = False
    ) -> Verdict:
        """Judge single poses (n, 3), by default wheels ahead."""
        site = self.site
        self.asked_poses += len(poses)
        bends, sigmas = np.full(len(poses), curvature), site.options.map_sigmas
        model = replace(site.options.model, backward=backward)
        return judge_poses(site.rover, site.terrain, poses, bends, model, sigmas=sigmas)[1]

    def _find_unobserved(
        self, pieces: Sequence[NDArray[np.float64]] | NDArray[np.float64], codes: Sequence[str]
    ) -> list[int]:
        """Return the indices of pieces that pass by their codes, but are over unseen ground."""
        site, passing = self.site, [row for row, code in enumerate(codes) if not code]
        if site.checked_ground is None or not passing:
            return []
        poses = np.concatenate([pieces[row] for row in passing])
        below = site.checked_ground.refused_below(site.rover, poses, site.blind_ground)
        firsts = np.cumsum([0, *(len(pieces[row]) for row in passing[:-1])])
        refused = np.logical_or.reduceat(below, firsts)
        return [passing[row] for row in np.flatnonzero(refused).tolist()]


@lru_cache(maxsize=1)
def _weaken(terrain: Terrain, share: float) -> Terrain:
    """Return a terrain with a share of its layer of friction: the same one for the next search."""
    layer = terrain.friction
    return terrain if layer is None else replace(terrain, friction=share * layer)


def cost_of_path(rover: Rover, pieces: Sequence[Piece], path: Candidate) -> float:
    """Return the cost [m] of a path of pieces that passes."""
    prices = np.repeat(
        [PRICES[one.gear] for one in pieces], [len(one.poses) - 1 for one in pieces]
    )
    time, energy = prices @ np.diff(path.prediction.time), float(path.prediction.energy[-1])
    priced = PieceVerdict("", float(time), energy, find_exposure(rover, path.prediction))
    return find_cost(rover, Gear.FORWARD, priced) + sum(one.surcharge for one in pieces)


def find_cost(rover: Rover, gear: Gear, piece: PieceVerdict) -> float:
    """Return the cost [m] of a piece of path, infinite if it fails."""
    if piece.code:
        return math.inf
    speed, climb = rover.nominal_speed, max(0.0, piece.energy) / rover.weight
    return PRICES[gear] * piece.time * speed + CLIMB * climb + RISK * piece.exposure * speed
