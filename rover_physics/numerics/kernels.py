# SPDX-License-Identifier: Apache-2.0
"""Decorators that compile kernels with Numba and keep them on disk."""

from rover_physics.numerics.kernel_cache import drop_stale_kernels
from rover_physics.numerics.kernel_compiler import Kernel

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


def _compile(function, **options):
    """Return a compiled function with a cache that does without a disk."""
    return Kernel(function, {**COMPILE_OPTIONS, **options})


drop_stale_kernels()
