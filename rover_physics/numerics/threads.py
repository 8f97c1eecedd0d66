"""How many threads a sweep is worth: to wake them takes longer than a short sweep takes alone."""

from collections.abc import Iterator
from contextlib import contextmanager

import numba

MAX_SERIAL_POSES = 2000
"""Poses under equal torques, or what takes as long, up to which one thread works alone."""


@contextmanager
def limit_threads(poses: int) -> Iterator[int]:
    """Let kernels use as many threads as they may, or one if there are few `poses`; yield it."""
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
