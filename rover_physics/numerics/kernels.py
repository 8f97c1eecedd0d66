"""Decorators that compile kernels with Numba, and the removal of stale cached kernels."""

import hashlib
from pathlib import Path

import numba

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
    "cache": True,
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
    return numba.njit(_nrt=False, **COMPILE_OPTIONS)(function)


def exact_kernel(function):
    """Compile a kernel that rounds after each operation, as NumPy does."""
    return numba.njit(_nrt=False, **{**COMPILE_OPTIONS, "fastmath": False})(function)


def allocating_kernel(function):
    """Compile a function that may allocate arrays."""
    return numba.njit(**COMPILE_OPTIONS)(function)


def sweep_kernel(function):
    """Compile a function with a parallel `prange` loop, such as over poses."""
    return numba.njit(parallel=LOOPS_ONLY, **COMPILE_OPTIONS)(function)


def drop_stale_kernels(package: Path) -> None:
    """Remove all cached kernels below `package` if any of its sources has changed.

    Numba checks only the file of a kernel, not the files of the kernels that it calls. After an
    edit in one file, callers in other files would otherwise run stale.
    """
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    stamp = package / "__pycache__" / "kernels.sha256"
    try:
        if stamp.exists() and stamp.read_text() == digest.hexdigest():
            return
        stamp.parent.mkdir(exist_ok=True)
        for cache in package.rglob("__pycache__"):
            for compiled in [*cache.glob("*.nbi"), *cache.glob("*.nbc")]:
                compiled.unlink(missing_ok=True)
        stamp.write_text(digest.hexdigest())
    except OSError:
        return  # a read-only installation, whose sources do not change


drop_stale_kernels(Path(__file__).parents[1])
