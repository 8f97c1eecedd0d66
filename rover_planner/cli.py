"""The command `rover_planner`: its subcommands and its exit code."""

import sys
from collections.abc import Sequence

import typer

from rover_physics.errors import RoverError
from rover_planner.command.demo import demo
from rover_planner.command.figure4 import figure4
from rover_planner.command.predict import predict
from rover_planner.command.reach import reach
from rover_planner.command.study import study
from rover_planner.command.terrain import terrain
from rover_planner.command.view import view
from rover_planner.errors import DemoError, PlanningError
from rover_planner.shell.exit_codes import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_INTERRUPTED
from rover_planner.shell.run_app import run_app

app = typer.Typer(
    help="Can a rocker-bogie rover traverse this path?",
    add_completion=False,
    pretty_exceptions_enable=False,
)
NEGATIVE_ARGUMENTS = {"ignore_unknown_options": True}
"""Makes typer accept negative numbers as arguments; options accept them anyway."""

app.command()(predict)
app.command(context_settings=NEGATIVE_ARGUMENTS)(reach)
app.command()(study)
app.command()(view)
app.command()(terrain)
app.command()(demo)
app.command()(figure4)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code; print one line on stderr for bad input."""
    try:
        code = run_app(app, "rover_planner", words)
    except (RoverError, PlanningError) as error:
        _print_refusal(str(error))
        return EXIT_BAD_INPUT
    except DemoError as error:
        _print_refusal(str(error))
        return EXIT_FAILED
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    return code if isinstance(code, int) else 0


def _print_refusal(text: str) -> None:
    """Print in one line why the command did not run."""
    print("rover_planner:", " ".join(text.split()), file=sys.stderr)
