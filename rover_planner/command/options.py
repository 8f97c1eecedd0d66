# SPDX-License-Identifier: Apache-2.0
"""Arguments and options that several subcommands share."""

from typing import Annotated

import typer

Vector = tuple[float, float, float]

RoverName = Annotated[
    str, typer.Argument(metavar="ROVER", help="Preset name (lsr1, m2020) or rover file.")
]
RoverOption = Annotated[str, typer.Option(help="Preset name (lsr1, m2020) or rover file.")]
TerrainName = Annotated[
    str,
    typer.Argument(metavar="TERRAIN", help="Preset name (spirit) or elevation map, .npz."),
]
Friction = Annotated[float | None, typer.Option(metavar="MU", help="Coulomb friction everywhere.")]
MaxTorque = Annotated[
    float | None, typer.Option(metavar="TAU", help="Largest wheel torque in N m.")
]
Policy = Annotated[
    str, typer.Option(metavar="equal|servo|optimal", help="How the wheels share the traction.")
]
SoilName = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Preset soil where the terrain names none (docs/soil.md)."),
]
MaxGap = Annotated[
    float,
    typer.Option(
        metavar="M", help="Widest unknown region of the map to interpolate in m; 0: none."
    ),
]
MaxCells = Annotated[
    int,
    typer.Option(metavar="N", min=4, help="Largest terrain file in cells; more are not unpacked."),
]
MAX_CELLS = 25_000_000
"""Default of the option --max-cells; a test compares it with that of `load_terrain`."""
Payload = Annotated[float | None, typer.Option(metavar="KG", help="Mass at the arm's tip in kg.")]
Sigmas = Annotated[
    float,
    typer.Option(
        metavar="K",
        help="Standard deviations to allow for where the map has elevation_std; 0: none.",
    ),
]
