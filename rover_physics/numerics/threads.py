"""Number of threads of a sweep; for a short sweep, waking threads takes longer than the sweep."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numba

MAX_SERIAL_POSES = 2000
"""Largest number of poses with equal torques, or equivalent effort, that use one thread."""


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
        sweep: Kernel of a sweep. Its last argument is the first chunk and the one after the last.
        inputs: Its other arguments.
        chunks: Number of chunks.
        threads: Number of threads. They take one chunk after another, as poses cost differently.
    """
    if threads == 1 or chunks == 1:
        sweep(*inputs, (0, chunks))
        return
    pool = ThreadPoolExecutor(min(threads, chunks))
    try:
        for done in [pool.submit(sweep, *inputs, (k, k + 1)) for k in range(chunks)]:
            done.result()
    finally:
        # An interrupted sweep ends with the chunks at work: they write into its arrays.
        pool.shutdown(cancel_futures=True)
