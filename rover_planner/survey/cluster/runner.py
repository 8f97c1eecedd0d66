# SPDX-License-Identifier: Apache-2.0
"""Runs a survey on a Dask cluster: chunks in waves, failed ones again, finished ones never."""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import ChunkReport, SurveyJob, survey_chunk
from rover_planner.survey.cluster.checks import (
    check_machine,
    check_memory,
    check_workers,
    wait_for_workers,
)
from rover_planner.survey.cluster.client import ATTEMPTS, ClusterSettings, open_client
from rover_planner.survey.layout import Index
from rover_planner.survey.store import SurveyStore

AHEAD = 3
"""Tasks that are submitted at a time, for each thread of the cluster: enough that no worker waits,
few enough that the scheduler holds little, whatever the size of the map."""
COUNT_PERIOD = 2.0
"""Time between two looks at how many threads the cluster has [s]; workers come and go."""
GONE = (
    "the scheduler is gone; finished chunks are kept, and the same command goes on with the others"
)

Task = Callable[[SurveyJob, Index], ChunkReport]
"""Work of a task."""


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
    check_machine(job, settings)
    with open_client(settings) as client, _errors_of_cluster():
        wait_for_workers(client)

        def check(workers: Sequence[str]) -> None:
            check_workers(job, client, workers)
            check_memory(job, client)

        return survey_with(client, job, chunks, on_chunk, task, check)


def survey_with(
    client: Any,
    job: SurveyJob,
    chunks: Iterable[Index],
    on_chunk: Callable[[ChunkReport], object] = lambda report: None,
    task: Task = survey_chunk,
    on_workers: Callable[[Sequence[str]], object] = lambda workers: None,
) -> SurveyOutcome:
    """Survey chunks on the cluster of a client; `on_workers` is called with workers that are new.

    Other arguments and errors are those of `run_survey`.
    """
    return _Run(job, client, on_chunk, task, on_workers).run(iter(chunks))


@contextlib.contextmanager
def _errors_of_cluster() -> Iterator[None]:
    """Turn a closed connection into a PlanningError."""
    from distributed.comm import CommClosedError

    try:
        yield
    except CommClosedError:
        raise PlanningError(GONE) from None


class _Run:
    """The chunks of a run: those under way, and what became of the others."""

    def __init__(
        self,
        job: SurveyJob,
        client: Any,
        on_chunk: Callable[[ChunkReport], object],
        task: Task,
        on_workers: Callable[[Sequence[str]], object],
    ):
        self._job, self._client, self._on_chunk, self._task = job, client, on_chunk, task
        self._on_workers, self._known = on_workers, frozenset[str]()
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
            threads = self._client.nthreads()
            self._threads = max(sum(threads.values()), 1)
            new, self._known = threads.keys() - self._known, frozenset(threads)
            if new:
                self._on_workers(sorted(new))
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
            raise PlanningError(GONE)
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
