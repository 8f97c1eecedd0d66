# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner`: its subcommands and its exit code."""

import os
from collections.abc import Sequence
from typing import Annotated

import typer

from rover_physics import __version__
from rover_planner.command.advise import advise
from rover_planner.command.demo import demo
from rover_planner.command.figure4 import figure4
from rover_planner.command.learn import learn
from rover_planner.command.plan import plan, replay_plan
from rover_planner.command.predict import predict
from rover_planner.command.reach import reach
from rover_planner.command.replay import replay
from rover_planner.command.study import study
from rover_planner.command.survey import reachable, survey
from rover_planner.command.terrain import terrain
from rover_planner.command.urdf import rover, urdf
from rover_planner.command.view import view
from rover_planner.command.warm_up import warm_up
from rover_planner.shell.poses import PlacesCommand, PoseCommand
from rover_planner.shell.run_app import run_app
from rover_planner.shell.run_program import run_program

NAME = "rover_planner"

app = typer.Typer(
    help="Can a rocker-bogie rover traverse this path?",
    add_completion=False,
    pretty_exceptions_enable=False,
)
NEGATIVE_ARGUMENTS = {"ignore_unknown_options": True}
"""Makes typer accept negative numbers as arguments; options accept them anyway."""


def _print_version(asked: bool) -> None:
    """Print the version and end, if it was asked for."""
    if asked:
        typer.echo(f"{NAME} {__version__}")
        raise typer.Exit


@app.callback()
def _take_options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    pass


app.command()(predict)
app.command()(advise)
app.command(cls=PoseCommand)(plan)
app.command()(replay_plan)
app.command(cls=PlacesCommand, context_settings=NEGATIVE_ARGUMENTS)(reach)
app.command()(survey)
app.command(cls=PoseCommand)(reachable)
app.command()(learn)
app.command()(study)
app.command(cls=PoseCommand)(view)
app.command()(terrain)
app.command(cls=PoseCommand)(replay)
app.command()(urdf)
app.command()(rover)
app.command()(demo)
app.command()(figure4)
app.command()(warm_up)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code; print one line on stderr for bad input."""
    # No command has matrices that are worth a thread, and each takes 20 ms to start.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Plugins would be looked for among all installed packages; a rover file has none.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    return run_program(NAME, lambda: run_app(app, NAME, argv))
