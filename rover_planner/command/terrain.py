# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner terrain`: makes a Mars-like terrain and saves it."""

from pathlib import Path
from typing import Annotated

import typer

from rover_planner.command.shared import argument


def terrain(
    out: Annotated[Path, argument("OUT", "Elevation map to write, .npz; is overwritten.")],
    seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 1,
    size: Annotated[float, typer.Option(help="Width and height in m, above 0.5.")] = 24.0,
    resolution: Annotated[float, typer.Option(help="Cell size in m.")] = 0.05,
    roughness: Annotated[
        float, typer.Option(help="RMS height difference of points 1 m apart in m, at most 100.")
    ] = 0.04,
    rocks: Annotated[float, typer.Option(help="Fraction of the ground that rocks cover.")] = 0.03,
    craters: Annotated[
        float, typer.Option(help="Craters of 1 m and larger per square metre.")
    ] = 0.02,
) -> None:
    """Make a Mars-like terrain with fractal relief, craters and rocks."""
    from rover_physics.terrain.grid import save_terrain
    from rover_planner.maps.known_map import describe_terrain
    from rover_planner.shell.progress import show_progress
    from rover_planner.worlds.mars_terrain import make_mars_terrain

    with show_progress() as progress:
        progress("make the terrain")
        made = make_mars_terrain(
            seed, size, resolution, roughness=roughness, rock_cover=rocks, crater_density=craters
        )
    save_terrain(out, made)
    typer.echo(f"wrote {out}: {describe_terrain(made)}")
