# SPDX-License-Identifier: Apache-2.0
"""Runs a survey on a Dask cluster: chunks in waves, failed ones again, finished ones never."""

import itertools
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import SurveyJob, survey_chunk
from rover_planner.survey.dask_cluster import (
    ATTEMPTS,
    ClusterSettings,
    check_machine,
    check_memory,
    check_workers,
    open_client,
    wait_for_workers,
)
from rover_planner.survey.layout import Index
from rover_planner.survey.store import SurveyStore

AHEAD = 3
"""Tasks that are submitted at a time, for each thread of the cluster: enough that no worker waits,
few enough that the scheduler holds little, whatever the size of the map."""
COUNT_PERIOD = 2.0
"""Time between two looks at how many threads the cluster has [s]; workers come and go."""
KEPT = "finished chunks are kept, and the same command goes on with the others"
GONE = f"the scheduler is gone; {KEPT}"
ALONE = f"the cluster has no worker any more; {KEPT}"


@dataclass
class SurveyOutcome:
    """The outcome of a run: counts, and the chunks that failed."""

    poses: int = 0
    """Number of poses judged."""
    done: int = 0
    """Number of chunks finished."""
    failed: dict[Index, str] = field(default_factory=dict)
    """Reasons of chunks that failed, by chunk."""


def run_survey(
    job: SurveyJob,
    chunks: Iterable[Index],
    settings: ClusterSettings,
    on_chunk: Callable[[int], object] = lambda poses: None,
    task: Callable[[SurveyJob, Index], int | OSError] = survey_chunk,
) -> SurveyOutcome:
    """Survey chunks on a cluster.

    Args:
        job: What to do.
        chunks: The chunks to survey.
        settings: Where.
        on_chunk: Called with the number of poses of each chunk that is finished.
        task: Work of a task.

    Returns:
        What became of them.

    Raises:
        PlanningError: No such scheduler, too little memory, no worker is left, or the store cannot
            be written.
    """
    from distributed.comm import CommClosedError

    notes = SurveyStore(job.store).notes
    check_machine(notes, settings)
    try:
        with open_client(settings) as client:
            wait_for_workers(client)
            return _Run(job, notes, client, iter(chunks), on_chunk, task).run()
    except CommClosedError:
        raise PlanningError(GONE) from None


class _Run:
    """The chunks of a run: those to come, those under way, and what became of the others."""

    def __init__(self, job, notes, client, chunks, on_chunk, task):
        self._job, self._notes = job, notes
        self._client, self._chunks = client, chunks
        self._on_chunk, self._task = on_chunk, task
        self._outcome = SurveyOutcome()
        self._chunk_of: dict[str, Index] = {}
        self._workers, self._threads, self._count_again = frozenset[str](), 1, 0.0

    def run(self) -> SurveyOutcome:
        """Survey the chunks."""
        from distributed import as_completed

        under_way, suspects = as_completed(), []
        self._fill(under_way)
        for future in under_way:
            chunk = self._chunk_of.pop(future.key)
            if future.status not in ("finished", "error"):
                raise PlanningError(GONE)
            if _is_killed(future.exception()):
                suspects.append(chunk)
            else:
                self._settle(chunk, future)
            future.release()
            self._fill(under_way)
        for chunk in suspects:
            # Alone, so that a chunk is not blamed for another with which its worker died.
            future = self._submit(chunk, "alone")
            self._settle(chunk, future)
            future.release()
        return self._outcome

    def _fill(self, under_way: Any) -> None:
        """Submit chunks until there are enough under way."""
        if time.monotonic() >= self._count_again:
            threads = self._client.nthreads()
            self._threads = max(sum(threads.values()), 1)
            new, self._workers = threads.keys() - self._workers, frozenset(threads)
            if new:
                check_workers(self._job, self._client, sorted(new))
                check_memory(self._notes, self._client)
            self._count_again = time.monotonic() + COUNT_PERIOD
        free = max(AHEAD * self._threads - len(self._chunk_of), 0)
        for chunk in itertools.islice(self._chunks, free):
            future = self._submit(chunk, "first")
            self._chunk_of[future.key] = chunk
            under_way.add(future)

    def _submit(self, chunk: Index, name: str) -> Any:
        """Submit a chunk; Dask tries it ATTEMPTS times."""
        key = f"survey-{chunk[0]}-{chunk[1]}-{name}"
        return self._client.submit(
            self._task, self._job, chunk, key=key, pure=False, retries=ATTEMPTS - 1
        )

    def _settle(self, chunk: Index, future: Any) -> None:
        """Note what became of a chunk; raise PlanningError if the others will fail as it did."""
        error = future.exception()  # waits for the end
        if error is None:
            poses = future.result()
            if isinstance(poses, OSError):
                told = f"{self._job.store}: cannot be written: {poses.strerror}; {KEPT}"
                raise PlanningError(told)
            self._outcome.done += 1
            self._outcome.poses += poses
            self._on_chunk(poses)
        elif type(error).__name__ in ("NoWorkerError", "NoValidWorkerError"):
            raise PlanningError(ALONE)
        elif _is_killed(error):
            self._outcome.failed[chunk] = f"its worker died {ATTEMPTS} times"
        else:
            self._outcome.failed[chunk] = f"{type(error).__name__}: {error}"


def _is_killed(error: BaseException | None) -> bool:
    return type(error).__name__ == "KilledWorker"
