"""How the numerical kernels are compiled: once, by numba, and cached beside their sources."""

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
"""What numba may make parallel. Looking for more than the loop doubles the time to compile."""
COMPILE_OPTIONS = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
}
"""A product and a sum may become one operation, rounded once; NaN and infinity are kept."""


def kernel(function):
    """Compile a scalar function that other kernels call; it can't allocate, nor return an array.

    Arrays are not reference-counted in it: counting every array of every argument at every call
    took most of the time of a settled pose.
    """
    return numba.njit(_nrt=False, **COMPILE_OPTIONS)(function)


def exact_kernel(function):
    """Compile a kernel that rounds after each operation, as numpy does."""
    return numba.njit(_nrt=False, **{**COMPILE_OPTIONS, "fastmath": False})(function)


def allocating_kernel(function):
    """Compile a function that makes work space for kernels."""
    return numba.njit(**COMPILE_OPTIONS)(function)


def sweep_kernel(function):
    """Compile a function whose `prange` loop runs over the poses of a path."""
    return numba.njit(parallel=LOOPS_ONLY, **COMPILE_OPTIONS)(function)


def drop_stale_kernels(package: Path) -> None:
    """Remove cached kernels anywhere below `package` that were compiled from other sources.

    numba looks only at the file that holds a kernel, not at the files of the kernels it calls,
    so an edit in one file would leave compiled callers in another file as they were.
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
        return  # a read-only installation: its sources do not change under us


drop_stale_kernels(Path(__file__).parents[1])
