"""Times single poses on rough ground, and checks their gaps by a dense look at whole wheels."""

import time
from collections.abc import Iterator

import numba
import numpy as np

from benchmarks.compiled import compiled
from benchmarks.grounds import made_reef, real_maps, reference_ground
from benchmarks.measure import Figure
from rover_physics.prediction.evaluation import (
    AHEAD,
    WORK,
    evaluate_pose,
    new_results,
    new_work,
    set_pose,
)
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import sweep_path
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from support.rough_grounds import fractal
from support.rover_geometry import wheel_gaps

POSES = 1_500
"""Poses on known ground that are timed one by one."""
LOOKED_AT = 150
"""Settled poses that a dense look checks."""
CELLS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""Cell sizes of the grounds that are checked [wheel radii]."""
KNOWN = (PoseStatus.SETTLED, PoseStatus.NOT_SETTLED)


@compiled
def evaluate_one(models, poses, works, results, i):
    """Evaluate pose i."""
    set_pose(models[0], poses, AHEAD, i, works[0])
    evaluate_pose(models[0], works[0], results[i])


def poses_anywhere(terrain: Terrain, count: int) -> np.ndarray:
    """Return poses (count, 3) at random known cells with random headings."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.isfinite(terrain.elevation))
    at = cells[rng.integers(0, len(cells), count)] + rng.uniform(-0.5, 0.5, (count, 2))
    x, y = terrain.origin[0] + terrain.resolution * at[:, 1], terrain.resolution * at[:, 0]
    return np.column_stack([x, terrain.origin[1] + y, rng.uniform(-np.pi, np.pi, count)])


def time_poses(rover: Rover, terrain: Terrain) -> tuple[np.ndarray, np.ndarray]:
    """Return CPU times [us] and statuses of poses on known ground."""
    poses = poses_anywhere(terrain, 20 * POSES)
    model, works = pack_model(rover, terrain), np.full(1, new_work(), WORK)
    results = new_results(len(poses))
    times = np.empty(len(poses))
    done = 0
    for i in range(len(poses)):
        began = time.thread_time_ns()
        evaluate_one(model.records, poses, works, results, i)
        times[i] = 1e-3 * (time.thread_time_ns() - began)
        done += results["status"][i] in KNOWN
        if done == POSES:
            break
    known = np.isin(results["status"][: i + 1], KNOWN)
    return times[: i + 1][known][1:], results["status"][: i + 1][known][1:]


def measure() -> list[Figure]:
    """Measure times of poses, then the gaps of wheels by brute force."""
    numba.set_num_threads(1)
    gaps = [figure for name in ("lsr1", "m2020") for figure in measure_gaps(load_rover(name))]
    return [*measure_times(load_rover("lsr1")), *gaps]


def measure_times(rover: Rover) -> Iterator[Figure]:
    """Time poses on rough grounds."""
    grounds = {"rocks": reference_ground("rocks"), **real_maps(), "made reef": made_reef()}
    for name, terrain in grounds.items():
        times, status = time_poses(rover, terrain)
        yield Figure("rough", f"{name}: a pose, mean", float(times.mean()), "us")
        yield Figure("rough", f"{name}: median", float(np.median(times)), "us")
        yield Figure("rough", f"{name}: 99 of 100", float(np.quantile(times, 0.99)), "us")
        yield Figure("rough", f"{name}: longest", float(times.max()), "us", 3000.0)
        settled = 100.0 * float((status == PoseStatus.SETTLED).mean())
        yield Figure("rough", f"{name}: settled", settled, "%")


def measure_gaps(rover: Rover) -> Iterator[Figure]:
    """Compare the gaps of settled poses with a dense look, on cells of several sizes."""
    size = rover.wheel.radius / 0.1
    for cells in CELLS:
        ground = fractal(int(100 * cells), half=3.0, roughness=0.06)
        scale = size * cells * 0.1 / ground.resolution
        larger = Terrain(
            ground.elevation * size,
            ground.resolution * scale,
            (ground.origin[0] * scale, ground.origin[1] * scale),
        )
        poses = poses_anywhere(larger, 20 * LOOKED_AT)
        prediction = sweep_path(rover, larger, poses)
        settled = np.flatnonzero(prediction.settled)[:LOOKED_AT]
        gaps = np.array([wheel_gaps(rover, larger, prediction, i) for i in settled])
        worst = 1e3 * np.abs(gaps).max(axis=1)
        share = 100.0 * float((worst <= 0.1).mean())
        name = f"{rover.name}, cells of {cells:g} radii, brute force"
        yield Figure("rough", f"{name}: poses within 0.1 mm", share, "%", 99.9, at_least=True)
        yield Figure("rough", f"{name}: the worst", float(worst.max()), "mm", 1.0)
