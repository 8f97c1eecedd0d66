# SPDX-License-Identifier: Apache-2.0
"""Progress on the terminal while a command runs: spinner, bar and steps."""

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


@contextmanager
def show_progress() -> Iterator[Callable[[str], None]]:
    """Show a spinner with the current step; show nothing if stderr is not a terminal.

    Yields:
        A function to call with the text of the next step.
    """
    console = Console(stderr=True)
    if not console.is_terminal:  # even a disabled bar of rich 13.7 prints an empty line
        yield lambda step: None
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("start")
        yield lambda step: progress.update(task, description=step)


@contextmanager
def show_bar(name: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a progress bar; show nothing if stderr is not a terminal.

    Yields:
        A function to call after each of the `total` pieces of work.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda: None
        return
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(name, total=total)
        yield lambda: progress.advance(task)


@contextmanager
def show_rate(name: str, total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Show a progress bar with the rate of the work; show nothing if stderr is not a terminal.

    Yields:
        A function to call with the number of pieces of work that are done, of `total`.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda count: None
        return
    rate = TextColumn("{task.fields[rate]}")
    columns = (*Progress.get_default_columns()[:3], rate, TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(name, total=total, rate="")
        began, done = time.monotonic(), 0

        def advance(count: int) -> None:
            nonlocal done
            done += count
            rate = done / max(time.monotonic() - began, 1e-9)
            progress.update(task, completed=done, rate=f"{rate:,.0f} {unit}/s")

        yield advance


@contextmanager
def show_names(total: int) -> Iterator[Callable[[str], None]]:
    """Show a progress bar with the name of the current piece of work; lines if no terminal.

    Yields:
        A function to call with the name of each of at most `total` pieces when it begins.
    """
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        yield lambda name: console.print(f"compiling {name}")
        return
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task, begun = progress.add_task("load kernels", total=total), itertools.count()

        def begin(name: str) -> None:
            progress.update(task, description=f"compile {name}", completed=next(begun))

        yield begin
        progress.update(task, description="kernels", completed=total)


class Steps:
    """Prints the steps of a command and their durations on the terminal."""

    def __init__(self) -> None:
        self.console = Console(highlight=False)
        if not self.console.is_terminal:
            self.console = Console(highlight=False, width=160)

    @contextmanager
    def step(self, text: str) -> Iterator[Any]:
        """Show a spinner while the block runs, then a line with its duration [s].

        The block may change the text of the status that it gets.
        """
        began = time.monotonic()
        with self.console.status(text) as status:
            yield status
        took = time.monotonic() - began
        self.console.print(f"[green]✓[/green] {status.status} [dim]{took:.1f} s[/dim]")
