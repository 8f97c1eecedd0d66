# SPDX-License-Identifier: Apache-2.0
"""Times single poses on one core."""

import time
from collections.abc import Iterator
from functools import partial

import numba
import numpy as np

from benchmarks.grounds import all_grounds, made_reef, poses_anywhere, real_maps
from benchmarks.measure import REPEATS, Figure, median_times
from rover_physics import (
    PoseStatus,
    Rover,
    SweepOptions,
    Terrain,
    load_rover,
    score_poses,
)
from rover_physics.names import OPTIMAL
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import look_up, pack_ground
from support.reference_cases import reference_ground

POSES = 1_500
"""Poses on known ground that are timed."""
LOOK_UPS, LOOKED_UP = 306, 100
"""Bare look-ups of the ground that a pose is compared with, and poses at which they are timed."""


def measure() -> list[Figure]:
    """Measure poses on all grounds."""
    numba.set_num_threads(1)
    return [*measure_poses(load_rover("lsr1"))]


def measure_poses(rover: Rover) -> Iterator[Figure]:
    """Measure poses anywhere, all at once and one by one (some 30 us a call are Python)."""
    usual = all_grounds()
    grounds = {"waves": reference_ground("settled_a/waves").terrain, **usual, **real_maps()}
    for name, terrain in (grounds | {"made reef": made_reef()}).items():
        poses = poses_anywhere(terrain, 20 * POSES)
        status = score_poses(rover, terrain, poses).status
        known = np.isin(status, (PoseStatus.SETTLED, PoseStatus.NOT_SETTLED))
        poses, status = poses[known][:POSES], status[known][:POSES]
        ground, places = pack_ground(terrain), places_below(rover, poses[:LOOKED_UP])
        score = partial(score_poses, rover, terrain, poses)
        looks = partial(sum_heights, ground.records, places)
        calls = score, partial(score, SweepOptions(policy=OPTIMAL)), looks
        equal, optimal, look = (1e6 * taken for taken in median_times(calls))
        pose, more = equal / len(poses), (optimal - equal) / len(poses)
        longest = max(_time(rover, terrain, poses[i : i + 1]) for i in range(len(poses)))
        settled = 100.0 * float((status == PoseStatus.SETTLED).mean())
        for what, value, unit, most, repeats in (
            ("mean, equal torques", pose, "us", 8.0 if name in usual else None, REPEATS),
            ("what optimal torques add", more, "us", 100.0, REPEATS),
            (f"over {LOOK_UPS} bare look-ups", pose / (look / LOOKED_UP), "x", None, REPEATS),
            ("longest", longest, "us", 3000.0, 1),
            ("settled", settled, "%", None, 1),
        ):
            yield Figure("pose", f"{name}: {what}", value, unit, most, repeats=repeats)


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
