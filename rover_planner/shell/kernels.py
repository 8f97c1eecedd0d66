# SPDX-License-Identifier: Apache-2.0
"""Loads the kernels of a program before it needs them; compiles those that are not on disk."""

import itertools
from collections.abc import Callable, Sequence

from rover_physics.compilation import NICENESS, Compilation, Step

LOADING_DELAY = 1.0
"""Time that a program has to itself before it loads what it needs later [s]."""


def load_kernels(
    first: Sequence[Step], behind: Sequence[Step], report: Callable[[str], object]
) -> Compilation:
    """Load kernels, and begin to load others while the program works.

    Args:
        first: What is needed at once: this function returns when it is loaded.
        behind: What is needed later. If `first` must be compiled, it is compiled meanwhile.
        report: Function that takes a line on each thing that is compiled, which takes seconds.

    Returns:
        What loads the others; to be closed when the program ends.
    """
    background, count = Compilation(behind, NICENESS), itertools.count(1)

    def tell_behind(name: str) -> None:
        report(f"compiling besides: {name}")

    def tell_first(name: str) -> None:
        background.start(tell_behind)
        report(f"compiling kernels {next(count)} of {len(first)}: {name}")

    try:
        with Compilation(first) as compilation:
            compilation.run(tell_first)
    except BaseException:  # such as KeyboardInterrupt
        background.close()
        raise
    background.start(tell_behind, LOADING_DELAY)
    return background
