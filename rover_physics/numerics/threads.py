# SPDX-License-Identifier: Apache-2.0
"""Number of threads of a sweep; for a short sweep, waking threads takes longer than the sweep."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from functools import partial
from typing import Any

import numba

MAX_SERIAL_POSES = 2000
"""Largest number of poses with equal torques, or equivalent effort, that use one thread."""

CALLS_IN_WORK = 2
"""Calls for each thread that run or wait in `run_in_turn`, so that a thread has its next one."""


@contextmanager
def limit_threads(poses: int) -> Iterator[int]:
    """Set the number of threads, one for few `poses`, else all that Numba allows; yield it."""
    allowed = numba.get_num_threads()
    used = allowed if poses > MAX_SERIAL_POSES else 1
    if used == allowed:
        yield used
        return
    numba.set_num_threads(used)
    try:
        yield used
    finally:
        numba.set_num_threads(allowed)


def run_chunks(sweep: Callable[..., Any], inputs: tuple, chunks: int, threads: int) -> None:
    """Run the chunks of a sweep, each once.

    Args:
        sweep: Kernel of a sweep. Its last arguments are the first chunk and the one after it.
        inputs: Its other arguments.
        chunks: Number of chunks.
        threads: Number of threads. They take one chunk after another, as poses cost differently.
    """
    if threads == 1 or chunks == 1:
        sweep(*inputs, 0, chunks)
        return
    parts = (partial(sweep, *inputs, k, k + 1) for k in range(chunks))
    run_in_turn(parts, min(threads, chunks))


def run_in_turn(calls: Iterable[Callable[[], object]], threads: int) -> None:
    """Run calls on some threads, in the context of this one; they begin in their order.

    Args:
        calls: The calls, drawn one by one while earlier ones run. When call k begins, call
            k - CALLS_IN_WORK * threads has ended, so the two may share a work space.
        threads: Number of threads.
    """
    if threads == 1:
        for call in calls:
            call()
        return
    pool = ThreadPoolExecutor(threads)
    waiting: deque[Future[object]] = deque()
    try:
        for call in calls:
            if len(waiting) == CALLS_IN_WORK * threads:
                waiting.popleft().result()
            waiting.append(pool.submit(copy_context().run, call))
        for one in waiting:
            one.result()
    finally:
        # An interrupted sweep ends with the calls at work: they write into its arrays.
        pool.shutdown(cancel_futures=True)
