# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner demo`: queries a running server, shows a table and a picture."""

from pathlib import Path
from typing import Annotated

import typer

from rover_planner.command import shared


def demo(
    map_name: shared.OptionalMap = None,
    out: Annotated[
        Path, typer.Option(help="Picture to write, .png; logs and a made terrain go beside it.")
    ] = Path("demo_output/demo.png"),
    rover: shared.RoverOption = "lsr1",
    seed: Annotated[int, typer.Option(help="Seed of the terrain and the goals.")] = 1,
    max_gap: shared.MaxGap = 0.2,
) -> None:
    """Query a traverse_server over ROS 2 for several goals and draw its answers.

    Exit code 0: it ran, with any answers. 1: a part of it failed. 2: bad input.
    """
    from rover_planner.demo.demo import run_demo

    run_demo(map_name, out, rover, seed, max_gap)
