"""Measures what a Dask scheduler sustains: the tasks of large surveys, without their work.

Scheduler, workers and client are processes of their own. The chunks of a survey go through them in
its waves and with its payloads, but the tasks return at once, or sleep for the time of a chunk.
"""

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import psutil

from benchmarks import dask_process
from benchmarks.measure import Figure
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_planner.survey.chunk_survey import ChunkReport, SurveyJob
from rover_planner.survey.cluster.client import ClusterSettings, open_client
from rover_planner.survey.cluster.runner import survey_with
from rover_planner.survey.layout import Index, SurveyLayout, choose_chunk
from rover_planner.survey.request import SurveyRequest

SIDES = (10_000, 31_623)
"""Sides of the maps whose tasks are handed out [cells]."""
HEADINGS = 8
"""Headings of these surveys."""
POSES_PER_SECOND = 50_000.0
"""Poses that a core judges in a second, by `benchmarks.run survey`; sets the time of a chunk."""
WORKERS = 100
"""Number of workers; they are threads of one process, whose own work limits how many there can be:
40 % of a core without tasks, and 7 ms for a task."""
MANY_WORKERS = 500
"""Number of workers of one more run, whose start takes from half a minute to several."""
MANY_TASKS = 3000
"""Number of its tasks, the first of the largest map."""
PACE = 2
"""Tasks that sleep do so for a chunk's time over this, so that so few workers ask for tasks as
often as so many times more."""
HALO = 32
"""Halo of a chunk; it does not matter here."""


@dataclass
class Cluster:
    """A cluster of processes."""

    client: Any
    """Its client, in this process."""
    scheduler: psutil.Process
    """Process of the scheduler."""


@dataclass(frozen=True)
class Load:
    """What a run cost."""

    seconds: float
    """Time by the clock [s]."""
    scheduler: float
    """CPU time of the scheduler [s]."""
    client: float
    """CPU time of the client [s]."""
    sent: int
    """Bytes sent by scheduler, client and workers."""
    memory: int
    """Largest growth of the scheduler's memory [bytes]."""


def measure() -> list[Figure]:
    """Measure tasks that return at once, and tasks that sleep."""
    dask_process.start_count()
    figures = []
    for side in SIDES:
        job = make_job(side)
        name = f"{float(side * side):.0e} cells".replace("e+0", "e")
        figures += [
            Figure("scheduler", f"{name}: tasks", len(job.layout.all_chunks), "", repeats=1),
            Figure("scheduler", f"{name}: time of a chunk", time_of_chunk(job), "s", repeats=1),
            *measure_rate(job, name),
        ]
    return figures + measure_sleep(make_job(SIDES[0])) + measure_many(make_job(SIDES[-1]))


def measure_rate(job: SurveyJob, name: str) -> list[Figure]:
    """Hand out tasks that return at once."""
    load = run(job, return_at_once)
    tasks = len(job.layout.all_chunks)
    rate = tasks / max(load.scheduler, load.client)
    told = (
        ("CPU time of the scheduler, a task", load.scheduler / tasks * 1e3, "ms"),
        ("CPU time of the client, a task", load.client / tasks * 1e3, "ms"),
        ("sent, a task", load.sent / tasks / 1e3, "kB"),
        ("growth of the scheduler", load.memory / 1e6, "MB"),
        ("tasks by the clock", tasks / load.seconds, "1/s"),
        ("tasks by the busier of scheduler and client", rate, "1/s"),
        ("workers that it feeds", rate * time_of_chunk(job), ""),
    )
    return [Figure("scheduler", f"{name}: {what}", value, unit, repeats=1)
            for what, value, unit in told]  # fmt: skip


def measure_sleep(job: SurveyJob) -> list[Figure]:
    """Hand out tasks that sleep, and compare with workers that never wait."""
    seconds, tasks = time_of_chunk(job) / PACE, len(job.layout.all_chunks)
    load = run(job, partial(sleep, seconds))
    least = -(-tasks // WORKERS) * seconds
    name = f"as often as {PACE * WORKERS} workers"
    return [
        Figure("scheduler", f"{name}: time", load.seconds / least, "x", repeats=1,
               against="workers that never wait"),
        Figure("scheduler", f"{name}: load of the scheduler", load.scheduler / load.seconds, "",
               repeats=1),
    ]  # fmt: skip


def measure_many(job: SurveyJob) -> list[Figure]:
    """Hand out tasks that return at once to many workers."""
    load = run(job, return_at_once, MANY_WORKERS, MANY_TASKS)
    tasks = min(MANY_TASKS, len(job.layout.all_chunks))
    told = (
        ("CPU time of the scheduler, a task", load.scheduler / tasks * 1e3, "ms"),
        ("CPU time of the client, a task", load.client / tasks * 1e3, "ms"),
        ("sent, a task", load.sent / tasks / 1e3, "kB"),
        ("growth of the scheduler", load.memory / 1e6, "MB"),
    )
    return [Figure("scheduler", f"{MANY_WORKERS} workers: {what}", value, unit, repeats=1)
            for what, value, unit in told]  # fmt: skip


def run(job: SurveyJob, task: Any, count: int | None = None, tasks: int | None = None) -> Load:
    """Survey chunks of a job by tasks, on workers of one process; by default all, on WORKERS."""
    count = WORKERS if count is None else count
    chunks = job.layout.all_chunks[:tasks]
    with open_cluster(count) as cluster:
        client, process = cluster.client, cluster.scheduler
        survey_with(client, job, chunks[: 2 * count], task=return_at_once)
        sent, before = count_bytes(client), process.memory_info().rss
        busy, mine, began = cpu_of(process), time.process_time(), time.perf_counter()
        most = before

        def look(report: ChunkReport) -> None:
            nonlocal most
            if report.chunk[1] == 0:
                most = max(most, process.memory_info().rss)

        survey_with(client, job, chunks, on_chunk=look, task=task)
        return Load(
            time.perf_counter() - began,
            cpu_of(process) - busy,
            time.process_time() - mine,
            count_bytes(client) - sent,
            most - before,
        )


@contextlib.contextmanager
def open_cluster(count: int) -> Iterator[Cluster]:
    """Start a scheduler and workers of one thread each."""
    with dask_process.open_process("scheduler") as scheduler:
        address = scheduler.stdout.readline().strip()
        with (
            dask_process.open_process("workers", address, str(count)) as workers,
            open_client(ClusterSettings(address)) as client,
        ):
            workers.stdout.readline()
            yield Cluster(client, psutil.Process(scheduler.pid))


def count_bytes(client: Any) -> int:
    """Return the bytes sent so far by scheduler, workers and client."""
    worker = next(iter(client.scheduler_info(n_workers=-1)["workers"]))
    by_workers = client.run(dask_process.count_sent, workers=[worker])[worker]
    return (
        client.run_on_scheduler(dask_process.count_sent) + by_workers + dask_process.count_sent()
    )


def cpu_of(process: psutil.Process) -> float:
    """Return the CPU time of a process [s]."""
    times = process.cpu_times()
    return float(times.user + times.system)


def make_job(side: int) -> SurveyJob:
    """Return the job of a square map."""
    request = SurveyRequest(load_rover("lsr1"), SweepOptions(), headings=HEADINGS)
    layout = SurveyLayout((side, side), 1, choose_chunk((side, side), 1, HEADINGS), HALO)
    return SurveyJob(request, layout, Path("survey.zarr").absolute(), "")


def time_of_chunk(job: SurveyJob) -> float:
    """Return the time of a whole chunk [s]."""
    return job.layout.chunk**2 * HEADINGS / POSES_PER_SECOND


def return_at_once(job: SurveyJob, chunk: Index) -> ChunkReport:
    """Return the report of a chunk without its work."""
    return ChunkReport(chunk, job.layout.chunk**2 * job.request.headings, 1.0)


def sleep(seconds: float, job: SurveyJob, chunk: Index) -> ChunkReport:
    """Sleep instead of the work of a chunk."""
    time.sleep(seconds)
    return replace(return_at_once(job, chunk), seconds=seconds)
