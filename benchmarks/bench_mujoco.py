"""Compares settling times with MuJoCo, which drops a rover and waits until it is at rest."""

import statistics
import time
from functools import lru_cache

import numba
import numpy as np

from benchmarks.bench_poses import run_settling
from benchmarks.grounds import random_poses, reference_ground
from benchmarks.measure import Figure, median_time
from benchmarks.mujoco_rover import DroppedRover, Settled
from rover_physics.prediction.evaluation import evaluate
from rover_physics.prediction.packed_model import pack_model
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus

POSES = 15
"""Poses on each ground."""
MANY = 4_000
"""Poses for timing this project's model; 15 poses take too little time to measure."""


@lru_cache(maxsize=1)
def rover():
    """Return the rover that is dropped."""
    return load_rover("lsr1")


def drop(ground, poses: np.ndarray) -> tuple[list[Settled], list[float]]:
    """Return where the rover comes to rest, and the time each settled pose took [s]."""
    dropped = DroppedRover(rover(), ground)
    settled, times = [], []
    for pose in poses:
        start = time.process_time()
        rest = dropped.settle(*pose)
        taken = time.process_time() - start
        if rest is not None:
            settled.append(rest)
            times.append(taken)
    return settled, times


def compare(ground, settled: list[Settled]) -> float:
    """Return the largest wheel centre error of each pose, median over all poses [mm]."""
    poses = np.array([rest.pose for rest in settled])
    ours = evaluate(pack_model(rover(), ground).records, poses)
    off = [
        np.linalg.norm(one.wheel_centres - rest.wheel_centres, axis=1).max()
        for one, rest in zip(ours, settled, strict=True)
        if one.status == PoseStatus.SETTLED
    ]
    return 1e3 * float(np.median(off))


def measure() -> list[Figure]:
    """Measure both on three grounds, at the poses where MuJoCo's rover came to rest."""
    numba.set_num_threads(1)
    figures = []
    for name in ("flat", "rocks", "fractal"):
        ground = reference_ground(name)
        model = pack_model(rover(), ground)
        settled, times = drop(ground, random_poses(ground, POSES))
        rests = np.array([rest.pose for rest in settled])
        poses = np.tile(rests, (MANY // len(rests), 1))
        ours = median_time(lambda: run_settling(model, poses)) / len(poses)  # noqa: B023
        theirs, count = statistics.median(times), len(times)
        against = "the same pose by MuJoCo"
        figures += [
            Figure("MuJoCo", f"{name}: drop and settle", 1e3 * theirs, "ms", repeats=count),
            Figure(
                "MuJoCo", f"{name}: time over ours, settling alone", theirs / ours, "x", 20_000.0,
                True, "ours at the same poses", count,
            ),
            Figure(
                "MuJoCo", f"{name}: worst wheel centre of a pose", compare(ground, settled), "mm",
                1.0, False, against, count,
            ),
        ]  # fmt: skip
    return figures
