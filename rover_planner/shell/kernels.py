# SPDX-License-Identifier: Apache-2.0
"""Loads the kernels of a program before it needs them; compiles those that are not on disk."""

import itertools
from collections.abc import Callable, Sequence

from rover_physics.compilation import BackgroundCompilation, Compilation, CompilationStep

LOADING_DELAY = 1.0
"""Time that a program has to itself before it loads what it needs later [s]."""

Report = Callable[[str], object]
"""Function that takes a line for people."""


def load_kernels(
    first: Sequence[CompilationStep], behind: Sequence[CompilationStep], report: Report
) -> BackgroundCompilation:
    """Load kernels, and begin to load others while the program works.

    Args:
        first: What is needed at once: this function returns when it is loaded.
        behind: What is needed later. If `first` must be compiled, it is compiled meanwhile.
        report: Function that takes a line on each thing that is compiled, which takes seconds.

    Returns:
        What loads the others; to be closed when the program ends.
    """

    def describe(names: Sequence[str]) -> None:
        if names:
            report(f"compiled besides: {', '.join(names)}")

    background, count = BackgroundCompilation(behind, describe), itertools.count(1)

    def begin(name: str) -> None:
        background.start()
        report(f"compiling kernels {next(count)} of {len(first)}: {name}")

    try:
        with Compilation(first) as compilation:
            compilation.run(begin)
    except BaseException:  # such as KeyboardInterrupt
        background.close()
        raise
    background.start(LOADING_DELAY)
    return background
