"""Number of threads of a sweep; for a short sweep, waking threads takes longer than the sweep."""

from collections.abc import Iterator
from contextlib import contextmanager

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
