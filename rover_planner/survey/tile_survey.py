# SPDX-License-Identifier: Apache-2.0
"""The survey of one tile: the rover at each of its cells and headings, and what is kept of it."""

from dataclasses import replace
from typing import Any

import numpy as np

from rover_physics.names import TORQUE_POLICIES
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.map_sweep import SCORES, find_scores
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.results.uses import find_codes
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import elevation_of, find_block_max
from rover_physics.traversability.judge import judge_poses
from rover_physics.traversability.pose_classes import (
    IMPASSABLE,
    RoverOnMap,
    classify_poses,
    hopeless_codes,
)
from rover_physics.traversability.verdict import WORSE
from rover_planner.survey.layers import (
    NO_LIMIT,
    QUANTITIES,
    list_layers,
    number_limits,
    pack_bits,
)
from rover_planner.survey.request import SurveyRequest

BATCH = 4096
"""Approximate number of poses whose results are in memory at a time."""
STRAIGHT, ON_THE_SPOT = 0.0, np.inf
"""Curvatures [1/m]."""


def survey_tile(
    request: SurveyRequest, terrain: Terrain | None, places: np.ndarray
) -> dict[str, np.ndarray]:
    """Judge the rover at places of a tile and all headings.

    Args:
        request: What is asked.
        terrain: The tile with all ground that the rover may touch; None if no cell is known.
        places: (n, 2) x, y [m] of the surveyed cells, in the frame of the terrain.

    Returns:
        Layers (n,).

    Raises:
        ModelError, SoilError: As `judge_poses`.
    """
    if terrain is None:
        return refuse_all(request, len(places))
    judge = TileJudge(request, terrain)
    count = max(1, BATCH // request.headings)
    parts = [judge.survey(places[k : k + count]) for k in range(0, len(places), count)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def warm_up_survey(request: SurveyRequest) -> None:
    """Survey one cell of a small ground, so that kernels are compiled and options are checked.

    Raises:
        ModelError, SoilError: As `survey_tile`.
    """
    span = 4.0 * max(x for x, _, _ in map(np.abs, request.rover.suspension.wheels.values()))
    ground = np.zeros((41, 41))
    ground[:, 0] = np.nan
    terrain = Terrain(ground, span / 20.0, (-span, -span))
    survey_tile(replace(request, headings=2), terrain, np.zeros((1, 2)))


def refuse_all(request: SurveyRequest, cells: int) -> dict[str, np.ndarray]:
    """Return the layers (cells,) of a tile of unknown ground."""
    empty = list_layers(request.headings, request.turns, request.chance)
    layers = {name: np.full(cells, value) for name, value in empty.items()}
    layers["worst_class"][:] = layers["best_class"][:] = IMPASSABLE
    layers["first_limit"][:] = number_limits()["unknown_ground"]
    if request.chance:
        layers["worst_failure_chance"][:] = layers["best_failure_chance"][:] = 1.0
    return layers


def outline_of(rover: Rover) -> tuple[float, float, float, float]:
    """Return the rectangle that holds wheels and belly, seen from above on flat ground.

    These are its rear, front, right and left edge [m], body frame.
    """
    wheel, belly = rover.wheel, rover.belly
    xs = [x for x, _, _ in rover.suspension.wheels.values()]
    side = max(y for _, y, _ in rover.suspension.wheels.values()) + 0.5 * wheel.width
    return (
        min(min(xs) - wheel.radius, belly.x[0]),
        max(max(xs) + wheel.radius, belly.x[1]),
        min(-side, belly.y[0]),
        max(side, belly.y[1]),
    )


class TileJudge:
    """Judges poses on the ground of a tile."""

    def __init__(self, request: SurveyRequest, terrain: Terrain):
        self._request, self._terrain, self._rover = request, terrain, request.rover
        self._on_map = RoverOnMap(self._rover, terrain, request.options, request.sigmas)
        self._model = pack_model(self._rover, terrain, request.options)
        self._numbers = number_limits()

    @quiet
    def survey(self, places: np.ndarray) -> dict[str, np.ndarray]:
        """Return the layers (n,) of places (n, 2) x, y [m]."""
        headings = self._request.headings
        grid = np.empty((len(places), headings, 3))
        grid[:, :, :2], grid[:, :, 2] = places[:, None], self._request.yaws
        poses = grid.reshape(-1, 3)
        refused = np.zeros(len(poses), bool)
        mark_unknown_below(self._model.ground.records, poses, outline_of(self._rover), refused)
        results, limits = self.judge(poses, STRAIGHT)
        number = self._numbers["unknown_ground"]
        limits[refused & ((limits == NO_LIMIT) | (limits > number))] = number
        numbers = find_scores(results).astype(np.float32)
        classes = self._classify(poses, limits, refused)
        layers = _sum_up(numbers, limits, classes, headings)
        if self._request.chance:
            chances = self._find_chances(poses, limits == NO_LIMIT).reshape(-1, headings)
            layers["worst_failure_chance"] = chances.max(axis=1)
            layers["best_failure_chance"] = chances.min(axis=1)
        if self._request.turns:
            layers["turnable_headings"] = pack_bits(
                self._find_turns(poses, limits == NO_LIMIT).reshape(-1, headings)
            )
        return layers

    def judge(self, poses: np.ndarray, bend: float) -> tuple[Any, np.ndarray]:
        """Judge poses in a motion of one curvature.

        Args:
            poses: (n, 3) x, y [m] and yaw [rad].
            bend: Curvature of the motion [1/m].

        Returns:
            RESULTs (n,), and the number (n,) of the first limit that fails, NO_LIMIT if none.
        """
        bends = np.full(len(poses), bend)
        results = self._model.evaluate(poses, motions=motions_of(self._model, poses, bends))
        codes = find_codes(self._model.limits, results)
        limits = np.array([self._numbers[code] for code in codes], np.uint8)
        if self._on_map.is_uncertain:
            rows = np.flatnonzero(limits == NO_LIMIT)
            if len(rows):
                _, verdict = judge_poses(
                    self._rover,
                    self._terrain,
                    poses[rows],
                    bends[rows],
                    self._request.options,
                    sigmas=self._request.sigmas,
                )
                limits[rows] = [self._numbers[code] for code in verdict.codes]
        return results, limits

    def _classify(self, poses: np.ndarray, limits: np.ndarray, refused: np.ndarray) -> np.ndarray:
        """Return the class (n,) of poses whose limits under the asked policy are known."""
        own = TORQUE_POLICIES.index(self._request.options.policy)
        classes = np.where(limits == NO_LIMIT, own, IMPASSABLE).astype(np.uint8)
        hopeless = [self._numbers[code] for code in hopeless_codes(self._on_map.is_uncertain)]
        is_open = ~refused & ~np.isin(limits, hopeless)
        others = [k for k in range(len(TORQUE_POLICIES)) if k != own]
        # A pose that passes is of another class only if a simpler drive passes, too.
        for passes, policies in ((True, range(own)), (False, others)):
            rows = np.flatnonzero(is_open & ((limits == NO_LIMIT) == passes))
            if len(rows) and len(policies):
                asked = [TORQUE_POLICIES[k] for k in policies]
                found = classify_poses(self._on_map, poses[rows], asked)
                better = (found >= 0) & (found < classes[rows])
                classes[rows[better]] = found[better]
        classes[refused] = IMPASSABLE
        return classes

    def _find_turns(self, poses: np.ndarray, passes: np.ndarray) -> np.ndarray:
        """Return (n,) whether the rover may turn on the spot to both sides."""
        turns = passes.copy()
        for bend in (ON_THE_SPOT, -ON_THE_SPOT):
            rows = np.flatnonzero(turns)
            if len(rows):
                turns[rows] = self.judge(poses[rows], bend)[1] == NO_LIMIT
        return turns

    def _find_chances(self, poses: np.ndarray, passes: np.ndarray) -> np.ndarray:
        """Return the chance of failure (n,) of each pose, 1 where it fails as told."""
        chances, rows = np.ones(len(poses), np.float32), np.flatnonzero(passes)
        if len(rows):
            asked = self._rover, self._terrain, poses[rows], None, self._request.options
            chances[rows] = judge_poses(*asked, sigmas=0, accepted_chance=1.0)[1].failure_chance_at
        return chances


def _sum_up(
    numbers: np.ndarray, limits: np.ndarray, classes: np.ndarray, headings: int
) -> dict[str, np.ndarray]:
    """Return the layers of cells from the numbers of their poses, all headings of a cell in turn.

    Args:
        numbers: (k, n) SCORES of `map_sweep`.
        limits: (n,) numbers of limits.
        classes: (n,) numbers of classes.
        headings: Number of headings.
    """
    by_cell = limits.reshape(-1, headings)
    passes = by_cell == NO_LIMIT
    first = np.where(passes, np.uint8(255), by_cell).min(axis=1)
    ranks = classes.reshape(-1, headings)
    layers = {
        "worst_class": ranks.max(axis=1),
        "best_class": ranks.min(axis=1),
        "first_limit": np.where(passes.all(axis=1), np.uint8(NO_LIMIT), first),
        "passable_headings": pack_bits(passes),
    }
    for name in QUANTITIES:
        values = numbers[SCORES.index(name)].reshape(-1, headings)
        best = np.fmin if WORSE[name] is np.fmax else np.fmax
        layers[f"worst_{name}"] = WORSE[name].reduce(values, axis=1)
        layers[f"best_{name}"] = best.reduce(values, axis=1)
    return layers


@exact_kernel
def mark_unknown_below(grounds, poses, outline, unknown):
    """Write into unknown (n,) whether the outline touches an unknown cell at poses (n, 3).

    A cell touches the outline if its centre is no farther from it than its corners are.

    Args:
        grounds: (1,) GROUND.
        poses: (n, 3) x, y [m] and yaw [rad].
        outline: Rear, front, right and left edge [m], body frame; seen from above.
        unknown: (n,) written.
    """
    ground = grounds[0]
    cell = 1.0 / ground.inverse_resolution
    near = 0.5 * np.sqrt(2.0) * cell
    rear, front, right, left = outline
    rear, front, right, left = rear - near, front + near, right - near, left + near
    farthest = np.hypot(max(-rear, front), max(-right, left))
    for row in range(poses.shape[0]):
        x, y, yaw = poses[row, 0], poses[row, 1], poses[row, 2]
        unknown[row] = False
        gx, gy = (x - ground.x0) / cell, (y - ground.y0) / cell
        if find_block_max(ground, gx, gy, farthest / cell, farthest / cell) < np.inf:
            continue
        c, s = np.cos(yaw), np.sin(yaw)
        low_i = max(int(np.floor((y - farthest - ground.y0) / cell)), 0)
        high_i = min(int(np.ceil((y + farthest - ground.y0) / cell)), ground.rows - 1)
        low_j = max(int(np.floor((x - farthest - ground.x0) / cell)), 0)
        high_j = min(int(np.ceil((x + farthest - ground.x0) / cell)), ground.columns - 1)
        for i in range(low_i, high_i + 1):
            for j in range(low_j, high_j + 1):
                height = elevation_of(ground, i, j)
                if height != height:
                    dx, dy = ground.x0 + j * cell - x, ground.y0 + i * cell - y
                    along, across = c * dx + s * dy, c * dy - s * dx
                    if rear <= along <= front and right <= across <= left:
                        unknown[row] = True
                        break
            if unknown[row]:
                break
