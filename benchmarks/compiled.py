"""A decorator that compiles benchmark code which calls the kernels of `rover_physics`."""

from collections.abc import Callable

from numba.core.caching import NullCache

from rover_physics.numerics.kernel_compiler import Kernel
from rover_physics.numerics.kernels import COMPILE_OPTIONS


def compiled(function: Callable) -> Kernel:
    """Compile a function with the kernels that it calls; nothing is kept on disk.

    `numba.njit` cannot call them: they have no machine code of their own.
    """
    kernel = Kernel(function, COMPILE_OPTIONS)
    kernel._cache = NullCache()
    return kernel
