"""Runs a typer app so that its caller decides about exit codes and messages."""

from collections.abc import Sequence
from typing import Any

import typer

from rover_planner.errors import PlanningError


def run_app(app: typer.Typer, name: str, words: Sequence[str] | None) -> Any:
    """Run an app and return what its command returns, 0 after it has printed its help.

    Args:
        app: The app.
        name: Name of the program, for its help.
        words: Its arguments; None takes those of the process.

    Raises:
        PlanningError: The words do not fit the app; says which and why.
        KeyboardInterrupt: It was interrupted.
    """
    try:
        return typer.main.get_command(app).main(
            args=None if words is None else list(words), prog_name=name, standalone_mode=False
        )
    except Exception as error:
        # typer has its own copy of click since 0.26, so there is no class of errors to name.
        if hasattr(error, "format_message"):
            raise PlanningError(error.format_message()) from error
        if type(error).__name__ == "Abort":
            raise KeyboardInterrupt from error
        raise
