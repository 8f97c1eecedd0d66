"""Measures a survey: cost of a chunk, two workers against one, memory and the scheduler."""

import pickle
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np

from benchmarks.measure import Figure, median_times
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_planner.survey.chunk_survey import ChunkReport, SurveyJob, compute_chunk
from rover_planner.survey.layout import Index, SurveyLayout, choose_chunk
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.runner import ClusterSettings, open_client, survey_with
from rover_planner.survey.survey import prepare_survey
from rover_planner.worlds.mars_terrain import make_mars_terrain

CELLS = 512
"""Side of the made Mars whose chunks are measured [cells]."""
CHUNK = 64
"""Side of these chunks [cells]."""
HEADINGS = 8
"""Headings of all surveys."""
REPEATS = 5
"""Repeats of the measurement of a chunk."""
WORKERS = (1, 2)
"""Numbers of workers that are compared, in turns."""
TURNS = 3
"""Turns of this comparison."""
TASKS = 2000
"""Empty tasks that the scheduler hands out."""
LARGE = (10_000, 31_623)
"""Sides of the maps whose number of tasks is told [cells]."""


def measure() -> list[Figure]:
    """Measure the parts of a survey."""
    numba.set_num_threads(1)
    mars = make_mars_terrain(7, CELLS * 0.05, 0.05)
    request = SurveyRequest(load_rover("lsr1"), SweepOptions(), headings=HEADINGS)
    with tempfile.TemporaryDirectory() as folder:
        save_terrain(Path(folder, "mars.npz"), mars)
        prepared = prepare_survey(request, f"{folder}/mars.npz", Path(folder, "out"), CHUNK)
        job = prepared.job
        return measure_chunk(job, mars) + measure_workers(job) + measure_scheduler(job)


def measure_chunk(job: SurveyJob, mars: Terrain) -> list[Figure]:
    """Compare a chunk in the middle of the map with the bare scores of its poses."""
    rows, columns = job.layout.chunks
    chunk = rows // 2, columns // 2
    (ys, xs), yaws = job.layout.cells_of(chunk), job.request.yaws
    x, y = (
        start + mars.resolution * np.arange(span.start, span.stop)
        for start, span in zip(mars.origin, (xs, ys), strict=True)
    )
    grid = np.broadcast_arrays(x[:, None], y[:, None, None], yaws)
    poses = np.stack(grid, axis=-1).reshape(-1, 3)
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


def measure_workers(job: SurveyJob) -> list[Figure]:
    """Compare numbers of workers by the clock, in turns, without the start of the cluster."""
    times: dict[int, list[float]] = {count: [] for count in WORKERS}
    memory = 0
    for _ in range(TURNS):
        for count in WORKERS:
            with open_client(ClusterSettings(workers=count)) as client:
                client.run(_warm_up, job)
                times[count].append(_time(lambda: survey_with(client, job, job.layout.all_chunks)))
                memory = max(memory, *client.run(_peak_memory).values())
    few, many = (float(np.median(times[count])) for count in (WORKERS[0], WORKERS[-1]))
    name, against = f"{WORKERS[-1]} workers", f"{WORKERS[0]} worker"
    return [
        Figure("survey", name, few / many, "x", 1.7, True, repeats=TURNS, against=against),
        Figure("survey", "largest memory of a worker", memory / 1e6, "MB", 1024.0, repeats=1),
    ]


def measure_scheduler(job: SurveyJob) -> list[Figure]:
    """Measure what the scheduler does for a task, and how many tasks large maps have.

    Client and scheduler are in this process, so its CPU time is theirs.
    """
    side = choose_chunk((LARGE[0], LARGE[0]), 1, HEADINGS)
    layout = SurveyLayout((LARGE[0], LARGE[0]), 1, side, job.layout.halo)
    large = replace(job, layout=layout)
    chunks = [(k // 100, k % 100) for k in range(TASKS)]
    with open_client(ClusterSettings(workers=1)) as client:
        client.run(_warm_up, job)
        before = _peak_memory()
        began = time.process_time()
        survey_with(client, large, chunks, task=do_nothing)
        took = time.process_time() - began
        grown = _peak_memory() - before
    sent = len(pickle.dumps((large, chunks[0])))
    back = len(pickle.dumps(ChunkReport((0, 0), 1, 1.0)))
    figures = [
        Figure("survey", "client and scheduler, a task", took / TASKS * 1e3, "ms", repeats=1),
        Figure("survey", "sent with a task", sent / 1e3, "kB", repeats=1),
        Figure("survey", "sent back", back / 1e3, "kB", repeats=1),
        Figure("survey", f"memory of the scheduler, {TASKS} tasks", grown / 1e6, "MB", repeats=1),
    ]
    for cells in LARGE:
        side = choose_chunk((cells, cells), 1, HEADINGS)
        tasks = (-(-cells // side)) ** 2
        figures.append(Figure("survey", f"tasks of {cells} x {cells} cells", tasks, "", repeats=1))
    return figures


def do_nothing(job: SurveyJob, chunk: Index) -> ChunkReport:
    """Return at once, as a task that takes no time."""
    return ChunkReport(chunk)


def _warm_up(job: SurveyJob) -> None:
    from rover_planner.survey.warm_up import warm_up_survey

    warm_up_survey(job.request)


def _peak_memory() -> int:
    """Return the largest memory that this process has had [bytes]."""
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _time(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began
