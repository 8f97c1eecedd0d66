"""Times paths against their poses: judged, written to a file, stopped at a failure, and in memory.

Ground is mild or rocky; paths are straight with 2 cm between waypoints, on one thread. Paths that
are judged in ways on and back too are part of the rocky ones. `python -m benchmarks.bench_paths N`
measures the memory of `predict` for N poses, default MANY.
"""

import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numba
import numpy as np

from benchmarks.grounds import all_grounds
from benchmarks.measure import Figure, median_time, median_times, show
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain, save_terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.command.prediction_files import read_poses, write_prediction
from rover_planner.planning.path_query import PathQueryOptions, answer_path_query
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.grounds import make_terrain, waves
from support.rough_grounds import bouldered

REPEATS = 7
"""Repeats of a measurement."""
MANY = 1_000_000
"""Poses of the path whose memory is measured."""
START, GOAL = (-5.0, 0.0, 0.0), (5.0, 0.0, 0.0)
"""Ends of the questions of 10 m."""


def straight(y: float, length: float, x: float = 0.0) -> np.ndarray:
    """Return poses (n, 3) along x with their middle at x, y."""
    along = x + np.arange(-0.5 * length, 0.5 * length, 0.02)
    return np.column_stack([along, np.full_like(along, y), np.zeros_like(along)])


def cases() -> dict[str, tuple[Terrain, list[np.ndarray], float]]:
    """Return ground, paths and largest ratio of judged to scored poses, by name."""
    spirit = load_terrain("spirit")
    row, column = np.argwhere(np.isfinite(spirit.elevation)).mean(axis=0)
    x, y = spirit.origin + spirit.resolution * np.array([column, row])
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    across = straight(0.0, 4.0) @ turn + (x, y, 0.5 * np.pi)
    found = {
        "waves": (make_terrain(waves, half=8.0), [straight(y, 10.0) for y in (-3, 0, 2)], 2.0),
        "Mars-like": (
            make_mars_terrain(1, 24.0, 0.05),
            [straight(y, 10.0) for y in (-6, -3, 3, 6)],
            2.0,
        ),
        "spirit": (spirit, [straight(y, 4.0, x), across], 2.0),
        "rocks": (
            bouldered(3, half=6.0, count=600),
            [straight(y, 9.0) for y in (-3, -1, 1, 3)],
            3.0,
        ),
    }
    real = [name for name in all_grounds() if "otira" in name]
    for name in real:
        ground = all_grounds()[name]
        xmin, xmax, ymin, ymax = ground.bounds
        x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)
        found[name] = ground, [straight(y + offset, 6.0, x) for offset in (0.0, 3.0)], 3.0
    return found


def measure_ratio(
    rover: Rover, name: str, ground: Terrain, paths: Sequence[np.ndarray], most: float
) -> list[Figure]:
    """Compare judged paths with their scored poses, in turns."""
    count = sum(map(len, paths))
    times = [
        median_times(
            [
                lambda: score_poses(rover, ground, path),  # noqa: B023
                lambda: judge_path(rover, ground, path),  # noqa: B023
                lambda: judge_path(rover, ground, path, stop_at_failure=True),  # noqa: B023
            ],
            REPEATS,
        )
        for path in paths
    ]
    scored, judged, stopped = (1e6 * sum(column) / count for column in zip(*times, strict=True))
    against = "poses scored, in turns"
    return [
        Figure("paths", f"{name}: a waypoint judged", judged, "us", repeats=REPEATS),
        Figure("paths", f"{name}: judged", judged / scored, "x", most, False, against, REPEATS),
        Figure(
            "paths",
            f"{name}: judged up to the first failure",
            stopped / scored,
            "x",
            None,
            False,
            against,
            REPEATS,
        ),
    ]


def measure_files(rover: Rover, folder: Path) -> list[Figure]:
    """Compare judging and writing with judging alone."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    np.savez(folder / "poses.npz", poses=np.concatenate([straight(y, 10.0) for y in (-6, 0, 6)]))
    poses = read_poses(folder / "poses.npz")

    def predict() -> None:
        path = read_poses(folder / "poses.npz")
        write_prediction(folder / "out.npz", *judge_path(rover, ground, path))

    alone, whole = median_times([lambda: judge_path(rover, ground, poses), predict], REPEATS)
    name = f"{len(poses):,} poses judged, read and written"
    return [Figure("paths", name, whole / alone, "x", 1.3, False, "judged", REPEATS)]


def measure_questions(rover: Rover) -> list[Figure]:
    """Measure questions of 10 m with one candidate and with nine."""
    ground, figures = make_mars_terrain(1, 24.0, 0.05), []
    for count, most in ((1, 6.0), (9, 40.0)):
        options = PathQueryOptions(count=count)
        taken = median_time(
            lambda: answer_path_query(rover, ground, START, GOAL, options),  # noqa: B023
            REPEATS,
        )
        name = f"question of 10 m, {count} candidate{'s' if count > 1 else ''}"
        figures.append(Figure("paths", name, 1e3 * taken, "ms", most, repeats=REPEATS))
    return figures


def measure_memory(count: int, folder: Path) -> Figure:
    """Measure the peak memory of `predict` for a path to and fro, in a process of its own."""
    save_terrain(folder / "ground.npz", make_mars_terrain(1, 24.0, 0.05))
    there = straight(-3.0, 10.0)
    course = np.concatenate([there, there[::-1]])
    poses = np.resize(np.tile(course, (count // len(course) + 1, 1)), (count, 3))
    np.savez(folder / "poses.npz", poses=poses)
    files = [str(folder / name) for name in ("ground.npz", "poses.npz", "out.npz")]
    command = [sys.executable, "-m", "rover_planner", "predict", "lsr1", *files]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return Figure("paths", f"predict {count:,} poses: peak memory", peak, "MiB", 1024.0, repeats=1)


def measure(count: int | None = None) -> list[Figure]:
    """Measure paths, files, questions and memory; the last for a number of poses or MANY."""
    numba.set_num_threads(1)
    rover, figures = load_rover("lsr1"), []
    for name, (ground, paths, most) in cases().items():
        figures += measure_ratio(rover, name, ground, paths, most)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        figures += measure_files(rover, Path(folder)) + measure_questions(rover)
        figures.append(measure_memory(count or MANY, Path(folder)))
    return figures


if __name__ == "__main__":
    show(measure(int(sys.argv[1]) if len(sys.argv) > 1 else None))
