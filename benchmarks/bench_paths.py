# SPDX-License-Identifier: Apache-2.0
"""Times paths against their poses: judged, written to a file, and in memory.

Ground is mild or rocky; paths are straight with 2 cm between waypoints, on one thread. Paths that
are judged in ways on and back too are part of the rocky ones.
"""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numba
import numpy as np

from benchmarks.grounds import real_maps, straight
from benchmarks.measure import Figure, median_time, median_times, peak_memory, run_predict
from rover_physics import (
    Rover,
    SweepOptions,
    Terrain,
    judge_path,
    load_rover,
    load_terrain,
    score_poses,
)
from rover_physics.names import EQUAL, SERVO
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_planner.command.prediction_files import read_poses, write_prediction
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.query import Site
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.grounds import bouldered, make_terrain, waves

REPEATS = 7
"""Repeats of a measurement."""
MOST_FOR_CHANCE = 4.0
"""Time of a verdict with its chance of failure over that without, at most, on mild ground."""
MANY = 1_000_000
"""Poses of the path whose memory is measured."""
QUESTIONS = (1, 6.0, 1.0), (9, 40.0, 1.0), (9, 200.0, ACCEPTED_CHANCE)
"""Candidates, largest time [ms] and accepted chance of questions."""
START, GOAL = (-5.0, 0.0, 0.0), (5.0, 0.0, 0.0)
"""Ends of the questions of 10 m."""


def measure() -> list[Figure]:
    """Measure paths, files, questions and memory."""
    numba.set_num_threads(1)
    rover, mars = load_rover("lsr1"), make_mars_terrain(1, 24.0, 0.05)
    figures = []
    for name, (ground, paths, most) in cases(mars).items():
        figures += measure_ratios(rover, name, ground, paths, most)
        figures += measure_chances(rover, name, ground, paths)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        figures += measure_files(rover, mars, Path(folder))
        figures += [measure_question(rover, mars, *row) for row in QUESTIONS]
        figures.append(measure_memory(mars, Path(folder)))
    return figures


def cases(mars: Terrain) -> dict[str, tuple[Terrain, list[np.ndarray], float]]:
    """Return ground, paths and largest ratio of judged to scored poses, by name."""
    spirit = load_terrain("spirit")
    row, column = np.argwhere(np.isfinite(spirit.elevation)).mean(axis=0)
    x, y = spirit.origin + spirit.resolution * np.array([column, row])
    across = straight(4.0)[:, [1, 0, 2]] + (x, y, 0.5 * np.pi)
    rocks = bouldered(3, half=6.0, count=600)
    found = {
        "waves": (make_terrain(waves, half=8.0), [straight(10.0, y=k) for k in (-3, 0, 2)], 1.6),
        "Mars-like": (mars, [straight(10.0, y=k) for k in (-6, -3, 3, 6)], 1.6),
        "spirit": (spirit, [straight(4.0, x, y), across], 1.6),
        "rocks": (rocks, [straight(9.0, y=k) for k in (-3, -1, 1, 3)], 2.5),
    }
    for name, ground in real_maps().items():
        if "otira" in name:
            xmin, xmax, ymin, ymax = ground.bounds
            x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)
            found[name] = ground, [straight(6.0, x, y + aside) for aside in (0.0, 3.0)], 3.0
    return found


def sum_times(paths: Sequence[np.ndarray], *calls: Callable[[np.ndarray], object]) -> np.ndarray:
    """Return the times of calls for all paths together [s], in turns."""
    times = [median_times([partial(call, path) for call in calls], REPEATS) for path in paths]
    return np.sum(times, axis=0)


def measure_ratios(
    rover: Rover, name: str, ground: Terrain, paths: Sequence[np.ndarray], most: float
) -> list[Figure]:
    """Compare judged paths with their scored poses, in turns."""
    score, judge = partial(score_poses, rover, ground), partial(judge_path, rover, ground)
    times = sum_times(paths, score, judge)
    scored, judged = (1e6 * times / sum(map(len, paths))).tolist()
    against = "poses scored, in turns"
    return [
        Figure("paths", f"{name}: a waypoint judged", judged, "us", repeats=REPEATS),
        Figure("paths", f"{name}: judged", judged / scored, "x", most, False, against, REPEATS),
    ]


def measure_chances(
    rover: Rover, name: str, ground: Terrain, paths: Sequence[np.ndarray]
) -> Iterator[Figure]:
    """Compare verdicts with chances of failure with those without, in turns."""
    for policy in (EQUAL, SERVO):
        judge = partial(judge_path, rover, ground, options=SweepOptions(policy=policy))
        without, told = sum_times(paths, judge, partial(judge, accepted_chance=1.0)).tolist()
        words, against = f"{name}: chance under {policy}", "judged without, in turns"
        ratio = {"target": MOST_FOR_CHANCE, "against": against, "repeats": REPEATS}
        yield Figure("paths", words, told / without, "x", **ratio)


def measure_files(rover: Rover, mars: Terrain, folder: Path) -> list[Figure]:
    """Compare judging and writing with judging alone."""
    np.savez(folder / "poses.npz", poses=np.concatenate([straight(10.0, y=k) for k in (-6, 0, 6)]))
    poses = read_poses(folder / "poses.npz")

    def predict() -> None:
        path = read_poses(folder / "poses.npz")
        write_prediction(folder / "out.npz", *judge_path(rover, mars, path))

    alone, whole = median_times([lambda: judge_path(rover, mars, poses), predict], REPEATS)
    name = f"{len(poses):,} poses judged, read and written"
    return [Figure("paths", name, whole / alone, "x", 1.3, False, "judged", REPEATS)]


def measure_question(
    rover: Rover, mars: Terrain, count: int, most: float, accepted: float
) -> Figure:
    """Measure a question of 10 m with a number of candidates and an accepted chance."""
    options = PathQueryOptions(count=count, accepted_chance=accepted)
    judge = PathJudge(Site(rover, mars, options))
    taken = median_time(lambda: judge.search(START, GOAL), REPEATS)
    name = f"question of 10 m, {count} candidate{'s' if count > 1 else ''}"
    name += f", chance up to {accepted:g}" if accepted < 1.0 else ""
    return Figure("paths", name, 1e3 * taken, "ms", most, repeats=REPEATS)


def measure_memory(mars: Terrain, folder: Path) -> Figure:
    """Measure the peak memory of `predict` for a path to and fro, in a process of its own."""
    there = straight(10.0, y=-3.0)
    run_predict(folder, mars, np.resize(np.concatenate([there, there[::-1]]), (MANY, 3)))
    name = f"predict {MANY:,} poses: peak memory"
    return Figure("paths", name, peak_memory(), "MiB", 1024.0, repeats=1)
