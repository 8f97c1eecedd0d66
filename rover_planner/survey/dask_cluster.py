# SPDX-License-Identifier: Apache-2.0
"""The cluster of a survey, of Dask: how it is opened, and what is checked of it beforehand."""

import contextlib
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any

from rover_planner.errors import PlanningError
from rover_planner.shell.run_program import ctrl_c_later
from rover_planner.survey.chunk_survey import SurveyJob, estimate_memory
from rover_planner.survey.store import StoreNotes

ATTEMPTS = 3
"""Number of times that a chunk is tried."""
CONNECT_TIME = 10.0
"""Longest time to reach a scheduler [s]."""
WORKERS_TIME = 300.0
"""Longest time to wait for the first worker of a scheduler [s]."""
ALONE_TIME = "60s"
"""Time after which tasks fail that no worker is there for: one may not start again on a busy
machine, and Dask would wait for ever."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
    "distributed.scheduler.no-workers-timeout": ALONE_TIME,
    "distributed.logging.distributed": "critical",
    "distributed.worker.profile.enabled": False,  # it looks at a worker's stack every 10 ms
    "distributed.admin.tick.interval": "1s",  # every 20 ms, it takes 2.5 % of a core a worker
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "500ms",
}
"""Settings of Dask's processes on this machine. What they do at rest counts as much as how they
treat tasks, as there are few of those."""


@dataclass(frozen=True)
class ClusterSettings:
    """The processes that compute the chunks."""

    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://10.0.0.1:8786; None: a cluster of this machine's
    processes."""
    workers: int | None = None
    """Number of worker processes on this machine (default: one a processor)."""
    memory_limit: str | None = None
    """Memory of a worker on this machine, such as "1GiB" (default: its share of the machine's)."""

    @property
    def memory_size(self) -> int:
        """The memory limit [bytes]; 0 if there is none, or if it is no size."""
        from dask.utils import parse_bytes

        try:
            return max(int(parse_bytes(self.memory_limit or 0)), 0)
        except (ValueError, OverflowError):
            return 0


def check_settings(settings: ClusterSettings) -> None:
    """Check the settings of a cluster before anything is done.

    Raises:
        PlanningError: A setting is invalid.
    """
    if settings.memory_limit is not None and settings.memory_size <= 0:
        raise PlanningError(
            f"memory limit is {settings.memory_limit!r}; it must be a size such as 1GiB"
        )
    if settings.scheduler is None:
        return
    for name, value in (("workers", settings.workers), ("memory-limit", settings.memory_limit)):
        if value is not None:
            raise PlanningError(
                f"--{name} is {value}; leave it out, as workers of --scheduler are its own"
            )
    if "://" not in settings.scheduler:
        raise PlanningError(
            f"scheduler is {settings.scheduler!r}; it must be an address such as "
            "tcp://10.0.0.1:8786"
        )


@contextlib.contextmanager
def open_client(settings: ClusterSettings) -> Iterator[Any]:
    """Connect to a cluster, or start one of this machine's processes.

    Raises:
        PlanningError: There is no such scheduler, or a setting is invalid.
    """
    import dask
    from distributed import Client, LocalCluster

    asked = SETTINGS | {"distributed.comm.timeouts.connect": CONNECT_TIME}
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(asked))
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable()  # the command tells in one line what Dask would tell on stderr
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
        resource_tracker.ensure_running()  # it unblocks the signal in the thread that starts it
        with ctrl_c_later():  # a terminal sends it to workers, too, which would print traces
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


def check_machine(notes: StoreNotes, settings: ClusterSettings) -> None:
    """Check that workers have the memory for the largest chunk, before a store is made for it.

    Those of a scheduler are asked if there are some by now.

    Raises:
        PlanningError: They do not have it, or there is no such scheduler.
    """
    from dask.system import CPU_COUNT
    from distributed.system import MEMORY_LIMIT

    if settings.scheduler is not None:
        with open_client(settings) as client:
            check_memory(notes, client)
        return
    share = MEMORY_LIMIT // CPU_COUNT  # of a worker, by Dask's default
    _compare(notes, settings.memory_size or share)
    workers, needed = settings.workers or CPU_COUNT, estimate_memory(notes)
    if workers * needed > MEMORY_LIMIT:
        raise PlanningError(
            f"{workers} workers need {workers * needed / 1e6:.0f} MB; this machine has "
            f"{MEMORY_LIMIT / 1e6:.0f} MB: give fewer --workers or a smaller --chunk"
        )


def wait_for_workers(client: Any) -> None:
    """Wait for the first worker of a cluster.

    Raises:
        PlanningError: None comes.
    """
    try:
        client.wait_for_workers(1, timeout=WORKERS_TIME)
    except TimeoutError:
        raise PlanningError(
            f"the scheduler has had no worker for {WORKERS_TIME:g} s; start some, the same "
            "command goes on"
        ) from None


def check_workers(job: SurveyJob, client: Any, workers: Sequence[str]) -> None:
    """Check that workers, by address, have this version and see the store.

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

    answers = client.run(find_fault, on_error="return", workers=list(workers))
    for worker, fault in answers.items():
        if fault and not isinstance(fault, OSError):  # that of one which went away
            raise PlanningError(f"worker {worker} {fault}")


def check_memory(notes: StoreNotes, client: Any) -> None:
    """Check that the largest chunk fits into the memory of each worker there is.

    Raises:
        PlanningError: It does not.
    """
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    limits = [worker["memory_limit"] // worker["nthreads"] for worker in workers]
    _compare(notes, min((limit for limit in limits if limit), default=0))


def _compare(notes: StoreNotes, least: int) -> None:
    """Compare the memory of the largest chunk with that of a worker [bytes], 0: no limit."""
    needed = estimate_memory(notes)
    if least and needed > least:
        side = notes.layout.chunk
        raise PlanningError(
            f"a chunk of {side} x {side} cells needs {needed / 1e6:.0f} MB; a worker has "
            f"{least / 1e6:.0f} MB: give a smaller --chunk or more memory"
        )
