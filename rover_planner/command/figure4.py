# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner figure4`: Figure 4 of the paper."""

from pathlib import Path
from typing import Annotated

import typer

from rover_planner.command import shared
from rover_planner.command.shared import argument
from rover_planner.shell.extras import need


def figure4(
    out: Annotated[Path, argument("OUT", "Picture to write, .png; is overwritten.")] = Path(
        "figure4.png"
    ),
    rover: shared.RoverOption = "lsr1",
) -> None:
    """Draw Figure 4 of the paper: how the torque of one wheel changes the loads of all."""
    need("matplotlib", "the picture")
    from rover_physics.rover.rover_file import load_rover
    from rover_planner.figures.figure4 import draw_figure4
    from rover_planner.shell.progress import show_progress

    model = load_rover(rover)
    with show_progress() as progress:
        progress(f"draw {out.name} (the first run compiles the model)")
        draw_figure4(out, model)
    typer.echo(f"wrote {out}")
