# SPDX-License-Identifier: Apache-2.0
"""Long sweeps in slices: between two slices the caller may look at a clock and stop the work."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

FIRST_SLICE = 512
"""Number of items in the first slice."""
SLICE_TIME = 0.05
"""Time of a slice that the size of the next one aims at [s]."""
MAX_SLICE = 1024
"""Largest number of items in a slice: the next ones may take ten times as long."""
MAX_GROWTH = 8.0
"""Largest growth from one slice to the next."""

Check = Callable[[], object]
"""Function that raises an error to stop the work, and returns to let it go on."""

_check: ContextVar[Check | None] = ContextVar("check", default=None)


@contextmanager
def interruptible(check: Check) -> Iterator[None]:
    """Call `check` between the slices of all sweeps in this block and thread.

    An error that `check` raises ends the sweep and leaves this block. The results of a sweep do
    not depend on its slices.
    """
    token = _check.set(check)
    try:
        yield
    finally:
        _check.reset(token)


def check_interruption() -> None:
    """Call the check of the innermost `interruptible` block, if there is one."""
    check = _check.get()
    if check is not None:
        check()


def slices(items: int) -> Iterator[slice]:
    """Yield slices that together cover `items` items, with a check before each.

    Outside `interruptible` there is a single slice. The sizes adapt to SLICE_TIME.
    """
    if _check.get() is None:
        yield slice(0, items)
        return
    first, size = 0, FIRST_SLICE
    while first < items:
        check_interruption()
        start = time.perf_counter()
        yield slice(first, min(first + size, items))
        first += size
        growth = SLICE_TIME / max(time.perf_counter() - start, 1e-9)
        size = min(max(1, round(size * min(growth, MAX_GROWTH))), MAX_SLICE)
