# SPDX-License-Identifier: Apache-2.0
"""Searches paths between random poses on real and made maps: the tables of docs/performance.md.

Run from the repository, on one core: taskset -c 0 python -m benchmarks.path_search --count 100
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any
from unittest import mock

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.grounds import real_maps
from benchmarks.measure import console, print_table
from rover_physics import Terrain, judge_path, load_rover
from rover_physics.names import EQUAL
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import FOUND, OUT_OF_TIME, SearchResult, find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site
from rover_planner.worlds.mars_terrain import make_mars_terrain

Pair = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Start and goal, (3,) each."""
Rows = list[dict[str, Any]]
"""One record for each pair."""
BUDGET = 2.0
"""Budget of a search [s]."""
NEAREST, FURTHEST = 4.0, 20.0
"""Distances of start and goal [m]."""
MADE = {
    "rocks": {"seed": 17, "rock_cover": 0.2, "crater_density": 0.0},
    "craters": {"seed": 18, "rock_cover": 0.01, "crater_density": 0.1},
}
"""Arguments of the made Mars terrains, 24 x 24 m at 5 cm."""
ROVER, OPTIONS = load_rover("lsr1"), PathQueryOptions(accepted_chance=1.0).change(policy=EQUAL)
"""The rover, and the options of `rover_planner plan`."""
DRAWN = 2000
"""Number of poses drawn at a time."""
SIDE, CHANGE = 1.0, 0.02
"""Side of the square of the map that changes, and largest change of the heights in it [m]."""


def search(
    terrain: Terrain,
    pair: Pair,
    budget: float = BUDGET,
    memory: EdgeMemory | None = None,
    ends_at_first: bool = False,
) -> SearchResult:
    """Search a path; CPU time is its clock, so that other programs do not cut its budget."""
    settings = LatticeSettings(budget=budget, ends_at_first=ends_at_first)
    with mock.patch("time.perf_counter", time.process_time):
        return find_path(SearchQuery(Site(ROVER, terrain, OPTIONS), *pair), settings, memory)


def draw_pairs(terrain: Terrain, count: int) -> list[Pair]:
    """Return random pairs of poses on which the rover can stand, NEAREST to FURTHEST apart."""
    rng, found = np.random.default_rng(0), []
    standing = draw_standing(terrain, rng)
    start, misses = next(standing), 0
    while len(found) < count:
        goal = next(standing)
        if NEAREST <= np.hypot(*(goal - start)[:2]) <= FURTHEST:
            found.append((start, goal))
            start, misses = next(standing), 0
        elif (misses := misses + 1) > 100:
            start, misses = next(standing), 0
    return found


def draw_standing(terrain: Terrain, rng: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """Yield random poses (3,) on which the rover can stand, without end."""
    xmin, xmax, ymin, ymax = terrain.bounds
    while True:
        poses = rng.uniform((xmin, ymin, -np.pi), (xmax, ymax, np.pi), (DRAWN, 3))
        codes = PathJudge(Site(ROVER, terrain, OPTIONS)).stand(poses)
        stands = np.array([code == "" for code in codes])
        if not stands.any():
            raise ValueError(f"the rover stands at none of {DRAWN} poses")
        yield from poses[stands]


def run_case(name: str, terrain: Terrain, asked: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield what is found of each pair of a ground; `asked` has the options of `main`."""
    pairs = draw_pairs(terrain, asked["count"])
    search(terrain, pairs[0])  # compiles, and reads the code from the disk
    for index, pair in enumerate(pairs):
        row = {"ground": name} | try_pair(terrain, pair)
        if row["outcome"] == OUT_OF_TIME and asked["longest"] > BUDGET:
            late = search(terrain, pair, asked["longest"], ends_at_first=True)
            row |= {"late": late.outcome == FOUND, "seconds_first": late.seconds_first}
        if index < asked["warm"]:
            answer = try_warm(terrain, pair, index)
            row |= {"warm_outcome": answer.outcome, "warm_first": answer.seconds_first}
        yield row


def try_pair(terrain: Terrain, pair: Pair) -> dict[str, Any]:
    """Search a path, judge it once more as `predict` does, and return what was found."""
    answer, passes = search(terrain, pair), None
    if answer.path is not None:
        passes = judge_path(ROVER, terrain, answer.path.poses, OPTIONS.model)[1].traversable
    told = ("outcome", "seconds_first", "seconds")
    return {name: getattr(answer, name) for name in told} | {"passes": passes}


def try_warm(terrain: Terrain, pair: Pair, seed: int) -> SearchResult:
    """Return the answer after a change of the map near a path.

    The path is searched first, then heights in a square on it change, and it is searched again
    with what is known. Without a first path, the square lies midway between start and goal.
    """
    memory = EdgeMemory()
    before = search(terrain, pair, memory=memory)
    middle = 0.5 * (pair[0] + pair[1])
    if before.path is not None:
        middle = before.path.poses[len(before.path.poses) // 2]
    return search(change_heights(terrain, middle, seed), pair, memory=memory)


def change_heights(terrain: Terrain, middle: np.ndarray, seed: int) -> Terrain:
    """Return the ground with other heights in a square of SIDE around a place: a smooth bump."""
    x = terrain.origin[0] + terrain.resolution * np.arange(terrain.elevation.shape[1])
    y = terrain.origin[1] + terrain.resolution * np.arange(terrain.elevation.shape[0])
    along, across = (np.abs(v - m) / (0.5 * SIDE) for v, m in zip((x, y), middle, strict=False))
    shape = np.clip(1.0 - across**2, 0.0, None)[:, None] * np.clip(1.0 - along**2, 0.0, None)
    height = np.random.default_rng(seed).uniform(-CHANGE, CHANGE)
    return replace(terrain, elevation=terrain.elevation + height * shape)


def describe(values: Sequence[float]) -> str:
    """Return the median and the 95th percentile of values as text."""
    known = [value for value in values if np.isfinite(value)]
    if not known:
        return "-"
    median, late = np.quantile(known, (0.5, 0.95), method="inverted_cdf")
    return f"{median:.2f}; {late:.2f}"


def summarise(rows: Rows) -> Iterator[tuple[str, str]]:
    """Yield the lines of the table for one ground, each a name and a value."""

    def column(name: str, rows: Rows = rows) -> list[Any]:
        return [row[name] for row in rows]

    outcomes, found = column("outcome"), [row for row in rows if row["outcome"] == FOUND]
    yield "pairs", str(len(rows))
    yield "outcomes", ", ".join(f"{name} {outcomes.count(name)}" for name in sorted({*outcomes}))
    yield "paths that judge_path passes", f"{sum(column('passes', found))} of {len(found)}"
    yield "first path [s]: median; 95 %", describe(column("seconds_first", found))
    all_found = [row for row in rows if row in found or row.get("late")]
    yield "found in the budget, of all that any search finds", f"{len(found)} of {len(all_found)}"
    yield "first path of all [s]: median; 95 %", describe(column("seconds_first", all_found))
    yield "whole search [s]", describe(column("seconds"))
    warm = [row for row in rows if row.get("warm_outcome") == FOUND]
    if warm:
        yield "warm: first path [s]", f"{describe(column('warm_first', warm))} ({len(warm)})"


def show(rows: Rows) -> None:
    """Print the table."""
    names = list(dict.fromkeys(row["ground"] for row in rows))
    columns = [dict(summarise([row for row in rows if row["ground"] == name])) for name in names]
    lines = dict.fromkeys(line for values in columns for line in values)
    cells = [(line, *(values.get(line) for values in columns)) for line in lines]
    headings = dict.fromkeys(("", *names), "")
    print_table("Median; 95th percentile. Times are CPU time", headings, cells)


def main(
    count: Annotated[int, typer.Option(help="Pairs for each ground.")] = 20,
    ground: Annotated[
        list[str] | None, typer.Option("--map", help="Beginning of a ground's name; repeatable.")
    ] = None,
    longest: Annotated[
        float, typer.Option(help="Budget in s of a second search where the first found none.")
    ] = 60.0,
    warm: Annotated[int, typer.Option(help="Pairs asked again after a change of the map.")] = 0,
) -> None:
    """Search paths between random poses and print what was found, in what time."""
    asked, rows = dict(locals()), []
    made = {name: make_mars_terrain(**arguments) for name, arguments in MADE.items()}
    for name, terrain in {**real_maps(), **made}.items():
        if ground and not any(name.startswith(beginning) for beginning in ground):
            continue
        began = time.perf_counter()
        for row in run_case(name, terrain, asked):
            rows.append(row)
            taken = time.perf_counter() - began
            console(stderr=True).print(f"{name} {len(rows)}, {taken:.0f} s", row)
    show(rows)


if __name__ == "__main__":
    typer.run(main)
