"""One search for a way, with what it took and how it compares."""

import time
from dataclasses import dataclass, replace
from unittest import mock

import numba
import numpy as np

from benchmarks.way_trials.grounds import Case, Pair
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.planning.ways.memory import EdgeMemory
from rover_planner.planning.ways.way_search import LatticeSettings, WayAnswer, find_way

SIDE = 1.0
"""Side of the square of the map that changes [m]."""
CHANGE = 0.02
"""Largest change of the heights in it [m]."""


@dataclass(frozen=True)
class Trial:
    """What one search found and took."""

    ground: str
    """Name of the ground."""
    pair: int
    """Index of the pair."""
    distance: float
    """Distance of start and goal [m]."""
    outcome: str
    """Outcome of the search."""
    seconds_first: float
    """CPU time to the first way [s], NaN without one."""
    seconds: float
    """CPU time of the search [s]."""
    length: float
    """Length of the way [m]."""
    cost: float
    """Its cost [m of level ground]."""
    bound: float
    """Bound on its cost before smoothing over the best of the lattice."""
    judged_share: float
    """Share of the lattice's edges that the model has judged."""
    repeatable: bool
    """Whether the clock did not end the search."""
    passes: bool | None
    """Whether `judge_path` passes the way; None without one."""


def search(
    case: Case,
    pair: Pair,
    budget: float,
    memory: EdgeMemory | None = None,
    terrain: Terrain | None = None,
) -> WayAnswer:
    """Search a way; its clock is the CPU time, so that other programs do not cut its budget."""
    settings = LatticeSettings(budget=budget)
    with mock.patch("time.perf_counter", time.process_time):
        return find_way(case.question(pair, terrain), settings, memory)


def try_pair(case: Case, pair: Pair, index: int, budget: float) -> Trial:
    """Search a way, judge it once more as `predict` does, and return what was found."""
    answer = search(case, pair, budget)
    return Trial(
        ground=case.name,
        pair=index,
        distance=float(np.hypot(*(pair[1] - pair[0])[:2])),
        outcome=answer.outcome,
        seconds_first=answer.seconds_first,
        seconds=answer.seconds,
        length=np.nan if answer.path is None else answer.path.length,
        cost=answer.cost,
        bound=answer.bound,
        judged_share=answer.edges_judged / max(1, answer.edges),
        repeatable=answer.repeatable,
        passes=None if answer.path is None else passes(case, answer),
    )


def passes(case: Case, answer: WayAnswer) -> bool:
    """Return whether the model passes a way with the options of `rover_planner predict`."""
    options, path = case.options.sweep_options(), answer.path
    assert path is not None
    return judge_path(case.rover, case.terrain, path.poses, options)[1].traversable


def try_warm(case: Case, pair: Pair, budget: float, seed: int) -> WayAnswer:
    """Return the answer after a change of the map near a way.

    The way is searched first, then heights in a square on it change, and it is searched again with
    what is known. Without a first way, the square lies midway between start and goal.
    """
    memory = EdgeMemory()
    before = search(case, pair, budget, memory)
    middle = 0.5 * (pair[0] + pair[1])
    if before.path is not None:
        middle = before.path.poses[len(before.path.poses) // 2]
    changed = change_heights(case.terrain, middle, seed)
    return search(case, pair, budget, memory, changed)


def change_heights(terrain: Terrain, middle: np.ndarray, seed: int) -> Terrain:
    """Return the ground with other heights in a square of SIDE around a place: a smooth bump."""
    x = terrain.origin[0] + terrain.resolution * np.arange(terrain.elevation.shape[1])
    y = terrain.origin[1] + terrain.resolution * np.arange(terrain.elevation.shape[0])
    along, across = (np.abs(v - m) / (0.5 * SIDE) for v, m in zip((x, y), middle, strict=False))
    shape = np.clip(1.0 - across**2, 0.0, None)[:, None] * np.clip(1.0 - along**2, 0.0, None)
    height = np.random.default_rng(seed).uniform(-CHANGE, CHANGE)
    return replace(terrain, elevation=terrain.elevation + height * shape)


def same_on_threads(case: Case, pair: Pair, budget: float) -> bool | None:
    """Return whether one and two threads find the same way to the bit; None if not repeatable."""
    answers = []
    before = numba.get_num_threads()
    for threads in (1, 2):
        numba.set_num_threads(threads)
        answers.append(search(case, pair, budget))
    numba.set_num_threads(before)
    one, two = answers
    if not (one.repeatable and two.repeatable):
        return None
    if one.path is None or two.path is None:
        return one.outcome == two.outcome
    return np.array_equal(one.path.poses, two.path.poses) and one.cost == two.cost
