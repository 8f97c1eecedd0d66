# SPDX-License-Identifier: Apache-2.0
"""Progress on the terminal while a command runs: spinner, bar and steps."""

import itertools
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress


@contextmanager
def show_progress() -> Iterator[Callable[[str], None]]:
    """Show a spinner with the current step; show nothing if stderr is not a terminal.

    Yields:
        A function to call with the text of the next step.
    """
    if not _is_terminal():
        yield lambda step: None
        return
    with _open_bar(None) as progress:
        task = progress.add_task("start")
        yield lambda step: progress.update(task, description=step)


@contextmanager
def show_bar(name: str, total: int, unit: str = "") -> Iterator[Callable[..., None]]:
    """Show a progress bar; show nothing if stderr is not a terminal.

    Args:
        name: What is done.
        total: Number of pieces of work.
        unit: What the pieces are, to show how many are done in a second; empty shows none.

    Yields:
        A function to call with the number of pieces that are done (default: one).
    """
    if not _is_terminal():
        yield lambda count=1: None
        return
    with _open_bar("{task.fields[rate]}") as progress:
        task = progress.add_task(name, total=total, rate="")
        began, done = time.monotonic(), 0

        def advance(count: int = 1) -> None:
            nonlocal done
            done += count
            speed = done / max(time.monotonic() - began, 1e-9)
            rate = f"{speed:,.0f} {unit}/s" if unit else f"{done}/{total}"
            progress.update(task, completed=done, rate=rate)

        yield advance


@contextmanager
def show_names(total: int) -> Iterator[Callable[[str], None]]:
    """Show a progress bar with the name of the current piece of work; lines if no terminal.

    Yields:
        A function to call with the name of each of at most `total` pieces when it begins.
    """
    if not _is_terminal():
        yield lambda name: print(f"compiling to {name}", file=sys.stderr, flush=True)
        return
    with _open_bar("{task.completed}/{task.total}") as progress:
        task, begun = progress.add_task("load kernels", total=total), itertools.count()

        def begin(name: str) -> None:
            progress.update(task, description=f"compile {name}", completed=next(begun))

        yield begin
        progress.update(task, description="kernels", completed=total)


def _is_terminal() -> bool:
    """Return whether stderr is a terminal; rich, which takes time to import, is for those."""
    return sys.stderr is not None and sys.stderr.isatty()


def _open_bar(behind: str | None) -> "Progress":
    """Return a bar with a text behind it; without one, a spinner that vanishes at its end."""
    from rich import progress
    from rich.console import Console

    console = Console(stderr=True, highlight=False)
    text, time_taken = progress.TextColumn("{task.description}"), progress.TimeElapsedColumn()
    if behind is None:
        spinner = progress.SpinnerColumn()
        return progress.Progress(spinner, text, time_taken, console=console, transient=True)
    left = progress.TimeRemainingColumn()
    columns = (text, progress.BarColumn(), progress.TextColumn(behind), time_taken, left)
    return progress.Progress(*columns, console=console)


class Steps:
    """Prints the steps of a command and their durations on the terminal."""

    def __init__(self) -> None:
        from rich.console import Console

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
