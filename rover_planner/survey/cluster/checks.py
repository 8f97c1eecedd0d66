# SPDX-License-Identifier: Apache-2.0
"""Checks of a cluster: enough memory, the same version, the same folders."""

from collections.abc import Sequence
from typing import Any

from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import SurveyJob, estimate_memory
from rover_planner.survey.cluster.client import ClusterSettings, open_client

WORKERS_TIME = 300.0
"""Longest time to wait for the first worker of a scheduler [s]."""


def check_machine(job: SurveyJob, settings: ClusterSettings) -> None:
    """Check that workers have the memory for the largest chunk, before a store is made for it.

    Those of a scheduler are asked if there are some by now.

    Raises:
        PlanningError: They do not have it, or there is no such scheduler.
    """
    from dask.system import CPU_COUNT
    from distributed.system import MEMORY_LIMIT

    if settings.scheduler is not None:
        with open_client(settings) as client:
            check_memory(job, client)
        return
    needed = estimate_memory(job)
    share = MEMORY_LIMIT // CPU_COUNT  # of a worker, by Dask's default
    _compare(job, needed, settings.memory_size or share)
    workers = settings.workers or CPU_COUNT
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


def check_workers(job: SurveyJob, client: Any, workers: Sequence[str] | None = None) -> None:
    """Check that workers have this version of the model and see the store.

    A worker that cannot import a task would never answer.

    Args:
        job: The work.
        client: Client of the cluster.
        workers: Addresses of the workers (default: all).

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

    asked = {} if workers is None else {"workers": list(workers)}
    for worker, fault in client.run(find_fault, on_error="return", **asked).items():
        if fault and not isinstance(fault, OSError):  # that of one which went away
            raise PlanningError(f"worker {worker} {fault}")


def check_memory(job: SurveyJob, client: Any) -> None:
    """Check that the largest chunk fits into the memory of a worker.

    Raises:
        PlanningError: It does not.
    """
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    limits = [worker["memory_limit"] // worker["nthreads"] for worker in workers]
    _compare(job, estimate_memory(job), min((limit for limit in limits if limit), default=0))


def _compare(job: SurveyJob, needed: int, least: int) -> None:
    """Compare the memory [bytes] of a chunk with that of a worker, 0 if it has no limit."""
    if least and needed > least:
        raise PlanningError(
            f"a chunk of {job.layout.chunk} x {job.layout.chunk} cells needs {needed / 1e6:.0f} MB"
            f"; a worker has {least / 1e6:.0f} MB: give a smaller --chunk or more memory"
        )
