# SPDX-License-Identifier: Apache-2.0
"""Times poses on rough ground, and checks their gaps by a dense look at whole wheels."""

import time
from collections.abc import Iterator

import numba
import numpy as np

from benchmarks.grounds import all_grounds, made_reef, real_maps
from benchmarks.measure import REPEATS, Figure, median_times
from rover_physics import PoseStatus, Rover, Terrain, judge_poses, load_rover, score_poses
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import look_up, pack_ground
from support.reference_cases import reference_ground
from support.rough_grounds import fractal
from support.rover_geometry import wheel_gaps

POSES = 1_500
"""Poses on known ground that are timed."""
LOOK_UPS, LOOKED_UP = 306, 100
"""Bare look-ups of the ground that a pose is compared with, and poses at which they are timed."""
LOOKED_AT = 150
"""Settled poses that a dense look checks."""
CELLS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""Cell sizes of the grounds that are checked [wheel radii]."""


def measure() -> list[Figure]:
    """Measure times of poses, then the gaps of wheels by brute force."""
    numba.set_num_threads(1)
    gaps = [figure for name in ("lsr1", "m2020") for figure in measure_gaps(load_rover(name))]
    return [*measure_times(load_rover("lsr1")), *gaps]


def poses_anywhere(terrain: Terrain, count: int) -> np.ndarray:
    """Return poses (count, 3) at random known cells with random headings."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.isfinite(terrain.elevation))
    at = cells[rng.integers(0, len(cells), count)] + rng.uniform(-0.5, 0.5, (count, 2))
    x, y = terrain.origin[0] + terrain.resolution * at[:, 1], terrain.resolution * at[:, 0]
    return np.column_stack([x, terrain.origin[1] + y, rng.uniform(-np.pi, np.pi, count)])


def measure_times(rover: Rover) -> Iterator[Figure]:
    """Time poses on rough grounds, all at once and one by one (some 30 us a call are Python)."""
    waves = reference_ground("settled_a/waves").terrain
    grounds = {"waves": waves, **all_grounds(), **real_maps(), "made reef": made_reef()}
    for name, terrain in grounds.items():
        poses = poses_anywhere(terrain, 20 * POSES)
        status = score_poses(rover, terrain, poses).status
        known = np.isin(status, (PoseStatus.SETTLED, PoseStatus.NOT_SETTLED))
        poses, status = poses[known][:POSES], status[known][:POSES]
        ground, places = pack_ground(terrain), places_below(rover, poses[:LOOKED_UP])
        calls = [
            lambda: score_poses(rover, terrain, poses),  # noqa: B023
            lambda: sum_heights(ground.records, places),  # noqa: B023
        ]
        pose, looks = median_times(calls)
        mean, ratio = 1e6 * pose / len(poses), pose / len(poses) / (looks / LOOKED_UP)
        times = [_time(rover, terrain, poses[i : i + 1]) for i in range(len(poses))]
        settled = 100.0 * float((status == PoseStatus.SETTLED).mean())
        for what, value, unit, most, repeats in (
            ("a pose, mean", mean, "us", None, REPEATS),
            (f"a pose over {LOOK_UPS} bare look-ups", ratio, "x", None, REPEATS),
            ("99 of 100", float(np.quantile(times, 0.99)), "us", None, 1),
            ("longest", max(times), "us", 3000.0, 1),
            ("settled", settled, "%", None, 1),
        ):
            yield Figure("rough", f"{name}: {what}", value, unit, most, repeats=repeats)


def places_below(rover: Rover, poses: np.ndarray) -> np.ndarray:
    """Return LOOK_UPS places (n, 2) [m] for each pose (n, 3), on lines below its wheels."""
    centres = [(x, side * y) for x, y, _ in rover.suspension.wheels.values() for side in (-1, 1)]
    along = rover.wheel.radius * np.linspace(-1.0, 1.0, LOOK_UPS // len(centres))
    x, y = (np.array(centres)[:, None] + np.stack([along, 0.0 * along], axis=-1)).reshape(-1, 2).T
    cosine, sine = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    places = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
    return (poses[:, None, :2] + places).reshape(-1, 2)


@kernel
def sum_heights(grounds, places):
    """Look up the ground at places (n, 2) [m], and do nothing else; grounds are (1,) GROUND."""
    total = 0.0
    for k in range(places.shape[0]):
        total += look_up(grounds[0], places[k, 0], places[k, 1])[0]
    return total


def _time(rover: Rover, terrain: Terrain, pose: np.ndarray) -> float:
    """Return the CPU time of a pose (1, 3) [us]."""
    began = time.thread_time_ns()
    score_poses(rover, terrain, pose)
    return 1e-3 * (time.thread_time_ns() - began)


def measure_gaps(rover: Rover) -> Iterator[Figure]:
    """Compare the gaps of settled poses with a dense look, on cells of several sizes."""
    size = rover.wheel.radius / 0.1
    for cells in CELLS:
        ground = fractal(int(100 * cells), half=3.0, roughness=0.06)
        scale = size * cells * 0.1 / ground.resolution
        x, y = ground.origin
        larger = Terrain(
            ground.elevation * size, ground.resolution * scale, (x * scale, y * scale)
        )
        poses = poses_anywhere(larger, 20 * LOOKED_AT)
        prediction, _ = judge_poses(rover, larger, poses, np.zeros(len(poses)))
        settled = np.flatnonzero(prediction.settled)[:LOOKED_AT]
        gaps = np.array([wheel_gaps(rover, larger, prediction, i) for i in settled])
        worst = 1e3 * np.abs(gaps).max(axis=1)
        share = 100.0 * float((worst <= 0.1).mean())
        name = f"{rover.name}, cells of {cells:g} radii, brute force"
        yield Figure("rough", f"{name}: poses within 0.1 mm", share, "%", 99.9, True, repeats=1)
        yield Figure("rough", f"{name}: the worst", float(worst.max()), "mm", 1.0, repeats=1)
