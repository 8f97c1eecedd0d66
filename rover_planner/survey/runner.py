"""Runs a survey on a Dask cluster: chunks in waves, failed ones again, finished ones never."""

import contextlib
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import ChunkReport, SurveyJob, estimate_memory, survey_chunk
from rover_planner.survey.layout import Index
from rover_planner.survey.store import SurveyStore

ATTEMPTS = 3
"""Number of times that a chunk is tried."""
AHEAD = 3
"""Tasks that are submitted at a time, for each thread of the cluster: enough that no worker waits,
few enough that the scheduler holds little, whatever the size of the map."""
COUNT_PERIOD = 2.0
"""Time between two looks at how many threads the cluster has [s]; workers come and go."""
CONNECT_TIME = 10.0
"""Longest time to reach a scheduler [s]."""

Task = Callable[[SurveyJob, Index], ChunkReport]
"""Work of a task."""


@dataclass(frozen=True)
class ClusterSettings:
    """Where the chunks are computed."""

    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://10.0.0.1:8786; None: a cluster of this machine's
    processes."""
    workers: int | None = None
    """Number of worker processes on this machine (default: one a processor)."""
    memory_limit: str | None = None
    """Memory of a worker on this machine, such as "1GiB" (default: its share of the machine's)."""


def check_settings(settings: ClusterSettings) -> None:
    """Check the settings of a cluster, and that its scheduler is there, before anything is done.

    Raises:
        PlanningError: A setting is invalid, or there is no such scheduler.
    """
    from dask.utils import parse_bytes

    if settings.memory_limit is not None:
        try:
            size = parse_bytes(settings.memory_limit)
        except ValueError:
            size = 0
        if size <= 0:
            raise PlanningError(
                f"memory limit is {settings.memory_limit!r}; it must be a size such as 1GiB"
            )
    if settings.scheduler is not None and "://" not in settings.scheduler:
        raise PlanningError(
            f"scheduler is {settings.scheduler!r}; it must be an address such as "
            "tcp://10.0.0.1:8786"
        )
    if settings.scheduler is not None:
        with open_client(settings):
            pass


@dataclass
class SurveyOutcome:
    """What became of the chunks of a run."""

    poses: int = 0
    """Number of poses judged."""
    seconds: float = 0.0
    """Time of all chunks together [s]."""
    done: int = 0
    """Number of chunks finished."""
    failed: dict[Index, str] = field(default_factory=dict)
    """Why chunks failed, by chunk."""


def run_survey(
    job: SurveyJob,
    chunks: Iterable[Index],
    settings: ClusterSettings,
    on_chunk: Callable[[ChunkReport], object] = lambda report: None,
    task: Task = survey_chunk,
) -> SurveyOutcome:
    """Survey chunks on a cluster.

    Args:
        job: What to do.
        chunks: The chunks to survey.
        settings: Where.
        on_chunk: Called after each chunk that is finished.
        task: Work of a task.

    Returns:
        What became of them. Chunks that failed are marked in the store.

    Raises:
        PlanningError: No such scheduler, too little memory, or the store cannot be written.
    """
    with open_client(settings) as client:
        check_workers(job, client)
        check_memory(job, client)
        return survey_with(client, job, chunks, on_chunk, task)


def survey_with(
    client: Any,
    job: SurveyJob,
    chunks: Iterable[Index],
    on_chunk: Callable[[ChunkReport], object] = lambda report: None,
    task: Task = survey_chunk,
) -> SurveyOutcome:
    """Survey chunks on the cluster of a client; arguments and errors as `run_survey`."""
    return _Run(job, client, on_chunk, task).run(iter(chunks))


@contextlib.contextmanager
def open_client(settings: ClusterSettings) -> Iterator[Any]:
    """Connect to a cluster, or start one of this machine's processes.

    Raises:
        PlanningError: There is no such scheduler, or a setting is invalid.
    """
    import dask
    from distributed import Client, LocalCluster

    quiet = {
        "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
        "distributed.logging.distributed": "critical",
        "distributed.comm.timeouts.connect": CONNECT_TIME,
        "distributed.worker.profile.enabled": False,  # it looks at a worker's stack every 10 ms
    }
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(quiet))
        if settings.scheduler is not None:
            try:
                client = Client(settings.scheduler, timeout=CONNECT_TIME)
            except (OSError, ValueError, TimeoutError) as error:
                raise PlanningError(
                    f"no scheduler at {settings.scheduler}: {error}; --scheduler must be the "
                    "address of one that runs, such as tcp://10.0.0.1:8786"
                ) from None
            yield stack.enter_context(client)
            return
        cluster = LocalCluster(
            n_workers=settings.workers,
            threads_per_worker=1,
            memory_limit=settings.memory_limit or "auto",
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": ":0"},  # any port, so that several can run
            silence_logs=logging.CRITICAL,
        )
        stack.enter_context(cluster)
        yield stack.enter_context(Client(cluster))


def check_workers(job: SurveyJob, client: Any) -> None:
    """Check that all workers have this version of the model and see the store.

    A worker that cannot import a task would never answer.

    Raises:
        PlanningError: A worker does not.
    """
    store, version, package = str(job.store), job.version, "rover_physics"

    def find_fault() -> str:  # sent by its code: a worker may have no module to import it from
        import importlib
        import os

        try:
            found = importlib.import_module(package).__version__
            importlib.import_module("rover_planner.survey.chunk_survey")
        except ImportError as error:
            return f"cannot import rover_planner: {error}"
        if found != version:
            return f"has version {found}, not {version}"
        return "" if os.path.isdir(store) else f"does not see {store}"

    for worker, fault in client.run(find_fault).items():
        if fault:
            raise PlanningError(f"worker {worker} {fault}")


def check_memory(job: SurveyJob, client: Any) -> None:
    """Check that the largest chunk fits into the memory of a worker.

    Raises:
        PlanningError: It does not.
    """
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    limits = [worker["memory_limit"] // worker["nthreads"] for worker in workers]
    least, needed = min((limit for limit in limits if limit), default=0), estimate_memory(job)
    if least and needed > least:
        raise PlanningError(
            f"a chunk of {job.layout.chunk} x {job.layout.chunk} cells needs {needed / 1e6:.0f} MB"
            f"; a worker has {least / 1e6:.0f} MB: give a smaller --chunk or more memory"
        )


class _Run:
    """The chunks of a run: those under way, and what became of the others."""

    def __init__(
        self,
        job: SurveyJob,
        client: Any,
        on_chunk: Callable[[ChunkReport], object],
        task: Task,
    ):
        self._job, self._client, self._on_chunk, self._task = job, client, on_chunk, task
        self._outcome = SurveyOutcome()
        self._chunk_of: dict[Any, Index] = {}
        self._attempts: dict[Index, int] = {}
        self._suspects: list[Index] = []
        self._threads, self._count_again = 1, 0.0

    def run(self, chunks: Iterator[Index]) -> SurveyOutcome:
        """Survey the chunks."""
        from distributed import as_completed

        under_way = as_completed()
        self._fill(under_way, chunks)
        for future in under_way:
            chunk = self._chunk_of.pop(future.key)
            if future.status == "finished":
                self._take(future.result())
            else:
                self._take_failure(chunk, future, under_way)
            future.release()
            self._fill(under_way, chunks)
        for chunk in self._suspects:
            self._survey_alone(chunk)
        return self._outcome

    def _survey_alone(self, chunk: Index) -> None:
        """Survey a chunk with which workers died; alone, so that it is not blamed for another."""
        key = f"survey-{chunk[0]}-{chunk[1]}-alone"
        future = self._client.submit(self._task, self._job, chunk, key=key, pure=False)
        error = future.exception()  # waits for the end
        if error is None:
            self._take(future.result())
        else:
            self._give_up(chunk, error)
        future.release()

    def _fill(self, under_way: Any, chunks: Iterator[Index]) -> None:
        """Submit chunks until there are enough under way."""
        if time.monotonic() >= self._count_again:
            self._threads = max(sum(self._client.nthreads().values()), 1)
            self._count_again = time.monotonic() + COUNT_PERIOD
        while len(self._chunk_of) < AHEAD * self._threads:
            chunk = next(chunks, None)
            if chunk is None:
                return
            self._submit(chunk, under_way)

    def _submit(self, chunk: Index, under_way: Any) -> None:
        attempt = self._attempts[chunk] = self._attempts.get(chunk, 0) + 1
        key = f"survey-{chunk[0]}-{chunk[1]}-{attempt}"
        future = self._client.submit(self._task, self._job, chunk, key=key, pure=False)
        self._chunk_of[key] = chunk
        under_way.add(future)

    def _take(self, report: ChunkReport) -> None:
        if report.refusal:
            raise PlanningError(
                f"{self._job.store}: cannot be written: {report.refusal}; finished chunks are "
                "kept, and the same command goes on with the others"
            )
        self._attempts.pop(report.chunk, None)
        self._outcome.done += 1
        self._outcome.poses += report.poses
        self._outcome.seconds += report.seconds
        self._on_chunk(report)

    def _take_failure(self, chunk: Index, future: Any, under_way: Any) -> None:
        """Try a chunk again, or give it up."""
        if future.status != "error":
            raise PlanningError(
                "the scheduler is gone; finished chunks are kept, and the same command goes on "
                "with the others"
            )
        error = future.exception()
        if type(error).__name__ == "KilledWorker":
            self._suspects.append(chunk)
        elif self._attempts[chunk] < ATTEMPTS:
            self._submit(chunk, under_way)
        else:
            self._give_up(chunk, error)

    def _give_up(self, chunk: Index, error: BaseException) -> None:
        """Mark a chunk as failed."""
        killed = type(error).__name__ == "KilledWorker"
        why = f"its worker died {ATTEMPTS} times" if killed else f"{type(error).__name__}: {error}"
        self._outcome.failed[chunk] = why
        SurveyStore(self._job.store).mark_failed(chunk)
