# SPDX-License-Identifier: Apache-2.0
"""Runs a program: it ends with an exit code and at most one line on stderr, also on a signal."""

import contextlib
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from rover_physics.errors import RoverError
from rover_planner.errors import FailedError

EXIT_OK = 0
"""The program ran, with any verdict of the model."""
EXIT_FAILED = 1
"""The input was good, but a part of the system failed, or the program has a defect."""
EXIT_BAD_INPUT = 2
"""The input is invalid or a library is missing; one line on stderr names it."""
EXIT_NOT_TRAVERSABLE = 3
"""mission_planner only: all queries were answered, and at least one goal is not traversable."""
EXIT_PIPE_CLOSED = 141
"""Nobody reads the output any more, as in `rover_planner ... | head`: 128 + SIGPIPE."""
EXIT_INTERRUPTED = 130
"""Interrupted by Ctrl-C: 128 + SIGINT, as in shells."""
END_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Signals of batch systems and closed terminals."""
MAX_LINE = 300
"""Largest number of characters of a line on stderr."""


def run_program(name: str, run: Callable[[], Any]) -> int:
    """Run a program and return its exit code.

    Bad input, a failure and an internal error print one line of at most MAX_LINE characters on
    stderr. In Python's development mode (-X dev) an internal error prints its trace as well.
    Warnings of libraries are not printed unless a filter asks for them (python -W).

    Args:
        name: Name of the program, at the start of the line.
        run: The program; an int that it returns is the exit code, anything else means 0.
    """
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files may be no text
    try:
        # Filters that are set already come first.
        with warnings.catch_warnings(action="ignore", append=True):
            code = run()
        if sys.stdout is not None:
            sys.stdout.flush()
    except RoverError as error:
        return end_with(name, EXIT_BAD_INPUT, str(error))
    except FailedError as error:
        return end_with(name, error.exit_code, str(error))
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        _drop_output()
        return EXIT_PIPE_CLOSED
    except OSError as error:
        _drop_output()
        return end_with(name, EXIT_FAILED, f"the system refused: {error}")
    except Exception as error:
        if sys.flags.dev_mode:
            traceback.print_exc()
        return end_with(name, EXIT_FAILED, f"internal error: {type(error).__name__}: {error}")
    return code if isinstance(code, int) else EXIT_OK


@contextlib.contextmanager
def end_as_by_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block as Ctrl-C does, so that child processes end in order.

    A signal that is ignored or handled already stays so, such as SIGHUP under nohup.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    mine = [one for one in END_SIGNALS if is_main and signal.getsignal(one) == signal.SIG_DFL]
    for one in mine:
        signal.signal(one, interrupt)
    try:
        yield
    finally:
        for one in mine:
            signal.signal(one, signal.SIG_DFL)


@contextlib.contextmanager
def ctrl_c_later() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block.

    Threads and processes that start in it, and all that these start, never see it.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with(name: str, code: int, text: str) -> int:
    """Print in one line on stderr why a program ends; return the exit code."""
    with contextlib.suppress(OSError):  # stderr itself may be closed or full
        print(one_line(f"{name}: {text}"), file=sys.stderr, flush=True)
    return code


def _drop_output() -> None:
    """Send what is left of the output nowhere; else Python complains about it when it ends."""
    with contextlib.suppress(OSError, ValueError, AttributeError):  # no real file in tests
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def one_line(text: str) -> str:
    """Return a text without line breaks and control characters, cut to MAX_LINE characters."""
    words = " ".join(text[: 10 * MAX_LINE].split())
    shown = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in words)
    return shown if len(shown) <= MAX_LINE else f"{shown[: MAX_LINE - 3]}..."
