"""Decorators that compile kernels with Numba and keep them on disk."""

import numba

from rover_physics.numerics.kernel_cache import KernelCache, drop_stale_kernels

LOOPS_ONLY = {
    "prange": True,
    "comprehension": False,
    "reduction": False,
    "inplace_binop": False,
    "setitem": False,
    "numpy": False,
    "stencil": False,
    "fusion": False,
}
"""What Numba may make parallel: `prange` loops only. The other analyses double compile time."""
COMPILE_OPTIONS = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
}
"""Options of every kernel. "contract" allows fused multiply-add; NaN and infinity are kept."""


def kernel(function):
    """Compile a scalar function that kernels call; it can neither allocate nor return arrays.

    Numba does not count references to arrays in it. Counting them at every call took most of the
    time of a settled pose.
    """
    return _compile(function, _nrt=False)


def exact_kernel(function):
    """Compile a kernel that rounds after each operation, as NumPy does."""
    return _compile(function, _nrt=False, fastmath=False)


def allocating_kernel(function):
    """Compile a function that may allocate arrays."""
    return _compile(function)


def sweep_kernel(function):
    """Compile a function with a parallel `prange` loop, such as over poses."""
    return _compile(function, parallel=LOOPS_ONLY)


def _compile(function, **options):
    """Return a compiled function with a cache that does without a disk."""
    compiled = numba.njit(**{**COMPILE_OPTIONS, **options})(function)
    # What njit(cache=True) does, but its own cache raises where it cannot write.
    compiled._cache = KernelCache(function)
    return compiled


drop_stale_kernels()
