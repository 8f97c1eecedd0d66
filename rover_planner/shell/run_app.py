# SPDX-License-Identifier: Apache-2.0
"""Runs a typer app; the caller handles exit codes and error messages."""

from collections.abc import Sequence
from typing import Any

import typer

from rover_planner.errors import PlanningError


def run_app(app: typer.Typer, name: str, argv: Sequence[str] | None) -> Any:
    """Run an app; return the result of its command, 0 after help was printed.

    Args:
        app: The app.
        name: Name of the program, for its help.
        argv: Its arguments; None takes those of the process.

    Raises:
        PlanningError: The arguments are invalid; the text says which and why.
        KeyboardInterrupt: It was interrupted.
        BrokenPipeError: Nobody reads its output any more.
    """
    try:
        return typer.main.get_command(app).main(
            args=None if argv is None else list(argv), prog_name=name, standalone_mode=False
        )
    except SystemExit as error:
        if isinstance(error.__context__, BrokenPipeError):  # typer's answer to a closed pipe
            raise BrokenPipeError from error
        raise
    except Exception as error:
        # typer vendors click since 0.26, so that no common error class exists.
        if hasattr(error, "format_message"):
            raise PlanningError(error.format_message()) from error
        if type(error).__name__ == "Abort":
            raise KeyboardInterrupt from error
        raise
