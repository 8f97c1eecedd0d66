"""Measures a survey: cost of a chunk, two workers against one and against the bare model."""

import contextlib
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks.measure import Figure, median_times
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_planner.survey.chunk_survey import SurveyJob, compute_chunk
from rover_planner.survey.cluster.client import ClusterSettings, open_client
from rover_planner.survey.cluster.runner import survey_with
from rover_planner.survey.layout import Index
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.survey import prepare_survey
from rover_planner.worlds.mars_terrain import make_mars_terrain

CELLS = 576
"""Side of the made Mars whose chunks are measured [cells]."""
CHUNK = 192
"""Side of these chunks [cells], that of a survey at so many headings."""
HEADINGS = 8
"""Headings of all surveys."""
REPEATS = 3
"""Repeats of the measurement of a chunk."""
WORKERS = (1, 2)
"""Numbers of workers that are compared, in turns."""
TURNS = 3
"""Turns of this comparison."""
COUNT = 2
"""Rows and columns of chunks in the middle of the map that are surveyed in a turn."""


def measure() -> list[Figure]:
    """Measure the parts of a survey."""
    numba.set_num_threads(1)
    mars = make_mars_terrain(7, CELLS * 0.05, 0.05)
    request = SurveyRequest(load_rover("lsr1"), SweepOptions(), headings=HEADINGS)
    with tempfile.TemporaryDirectory() as folder:
        save_terrain(Path(folder, "mars.npz"), mars)
        prepared = prepare_survey(request, f"{folder}/mars.npz", Path(folder, "out"), CHUNK)
        job = prepared.job
        return measure_chunk(job, mars) + measure_workers(job, mars)


def measure_chunk(job: SurveyJob, mars: Terrain) -> list[Figure]:
    """Compare a chunk in the middle of the map with the bare scores of its poses."""
    rows, columns = job.layout.chunks
    chunk = rows // 2, columns // 2
    poses, yaws = poses_of(job, mars, chunk), job.request.yaws
    request = job.request
    turning = replace(job, request=replace(request, turns=True))
    bare, whole, turns = median_times(
        [
            lambda: score_poses(request.rover, mars, poses, request.options),
            lambda: compute_chunk(job, chunk),
            lambda: compute_chunk(turning, chunk),
        ],
        REPEATS,
    )
    cells = len(poses) / len(yaws)
    against = "score_poses"
    return [
        Figure("survey", "cells a second and core", cells / whole, "1/s", repeats=REPEATS),
        Figure("survey", "poses a second and core", len(poses) / whole, "1/s", repeats=REPEATS),
        Figure("survey", "chunk", whole / bare, "x", 1.1, repeats=REPEATS, against=against),
        Figure(
            "survey", "chunk with --turns", turns / bare, "x", repeats=REPEATS, against=against
        ),
    ]


def measure_workers(job: SurveyJob, mars: Terrain) -> list[Figure]:
    """Compare numbers of workers and the bare scores of the same poses, all in turns.

    The clusters stay open, so that their start is not counted. What is compared with bare scores
    is the CPU time of all processes, which other programs affect less than the clock.
    """
    rows, columns = job.layout.chunks
    half = COUNT // 2
    middle = [
        (i, j)
        for i in range(max(rows // 2 - half, 0), rows // 2 + half)
        for j in range(max(columns // 2 - half, 0), columns // 2 + half)
    ]
    poses = np.concatenate([poses_of(job, mars, chunk) for chunk in middle])
    few, many = WORKERS[0], WORKERS[-1]
    clock: dict[int, list[float]] = {0: [], 1: []}
    cpu: dict[int, list[float]] = {0: [], 1: []}
    bare, memory = [], 0
    with contextlib.ExitStack() as stack:
        clients = [
            stack.enter_context(open_client(ClusterSettings(workers=count)))
            for count in (few, many)
        ]
        for client in clients:
            client.run(_warm_up, job)
        score_poses(job.request.rover, mars, poses[:100], job.request.options)
        for turn in range(TURNS):
            for k in (0, 1) if turn % 2 else (1, 0):
                busy, began = _cpu_of_all(clients[k]), time.perf_counter()
                survey_with(clients[k], job, middle)
                clock[k].append(time.perf_counter() - began)
                cpu[k].append(_cpu_of_all(clients[k]) - busy)
            busy = time.process_time()
            score_poses(job.request.rover, mars, poses, job.request.options)
            bare.append(time.process_time() - busy)
        memory = max(max(client.run(_peak_memory).values()) for client in clients)
    one, two, plain = (float(np.median(times)) for times in (cpu[0], cpu[1], bare))
    speed = float(np.median(clock[0]) / np.median(clock[1]))
    name, against = f"{many} workers", f"{few} worker"
    return [
        Figure("survey", name, speed, "x", 1.7, True, repeats=TURNS, against=against),
        Figure("survey", f"{name}, CPU time of all processes", two / one, "x", repeats=TURNS,
               against=against),
        Figure("survey", f"{against}, CPU time of all processes", one / plain, "x", 1.1,
               repeats=TURNS, against="score_poses"),
        Figure("survey", "largest memory of a worker", memory / 1e6, "MB", 1024.0, repeats=1),
    ]  # fmt: skip


def poses_of(job: SurveyJob, mars: Terrain, chunk: Index) -> np.ndarray:
    """Return the poses (n, 3) of a chunk, x, y [m] and yaw [rad]."""
    (ys, xs), yaws = job.layout.cells_of(chunk), job.request.yaws
    x, y = (
        start + mars.resolution * np.arange(span.start, span.stop)
        for start, span in zip(mars.origin, (xs, ys), strict=True)
    )
    grid = np.broadcast_arrays(x[:, None], y[:, None, None], yaws)
    return np.stack(grid, axis=-1).reshape(-1, 3)


def _warm_up(job: SurveyJob) -> None:
    from rover_planner.survey.warm_up import warm_up_survey

    warm_up_survey(job.request)


def _peak_memory() -> int:
    """Return the largest memory that this process has had [bytes]."""
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _cpu_of_all(client: Any) -> float:
    """Return the CPU time of this process and the workers of a client [s]."""
    return time.process_time() + sum(client.run(time.process_time).values())
