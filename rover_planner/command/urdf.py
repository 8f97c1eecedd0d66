# SPDX-License-Identifier: Apache-2.0
"""The commands `rover_planner urdf` and `rover`: rover files to URDF and back."""

from pathlib import Path
from typing import Annotated

import typer

from rover_planner.command import shared
from rover_planner.command.shared import argument, option


def urdf(
    rover: shared.RoverName,
    out: Annotated[Path, argument("OUT", "URDF to write; is overwritten.")],
    joint_map: Annotated[
        Path | None, option("FILE", "Write the joint map that reads it back.", "--map")
    ] = None,
    hardware: Annotated[
        str,
        option(
            "PLUGIN",
            "Add <ros2_control> for a plugin, such as mock_components/GenericSystem.",
            "--ros2-control",
        ),
    ] = "",
) -> None:
    """Write a rover as URDF, with inertias, joint limits and collision cylinders."""
    from rover_physics.rover.rover_file import load_rover, save_yaml
    from rover_physics.rover.urdf.joint_map import map_of
    from rover_physics.rover.urdf.write_urdf import write_urdf

    shared.keep_inputs((rover,), out, joint_map)
    model = load_rover(rover)
    write_urdf(out, model, hardware)
    if joint_map is not None:
        comment = f"Joints of {model.name}'s URDF, and what the URDF does not tell."
        save_yaml(joint_map, map_of(model), comment)
    typer.echo(f"wrote {out}: {model.name}, {model.total_mass:.6g} kg")


def rover(
    out: Annotated[Path, argument("OUT", "Rover file to write, .yaml; is overwritten.")],
    from_urdf: Annotated[Path, option("FILE", "URDF of the rover.", "--from-urdf")],
    joint_map: Annotated[
        Path, option("FILE", "Joint map, .yaml (docs/integration/robot.md).", "--map")
    ],
) -> None:
    """Write a rover file from a URDF and a joint map."""
    from rover_physics.rover.rover_file import save_rover
    from rover_physics.rover.urdf.read_rover import MAX_TILT, rover_from_urdf

    shared.keep_inputs((from_urdf, joint_map), out)
    read = rover_from_urdf(from_urdf, joint_map)
    comment = (
        f"From {from_urdf.name} by {joint_map.name}. SI units. Positions: left side, body frame\n"
        "(x forward, y left, z up, origin midway between the rocker pivots), on flat ground."
    )
    save_rover(out, read.rover, comment)
    typer.echo(
        f"wrote {out}: {read.rover.name}, {read.rover.total_mass:.6g} kg, left and right differ "
        f"by {1e3 * read.asymmetry:.3g} mm"
    )
    if read.tilt > MAX_TILT:
        typer.echo(
            f"rockers turn about pivots that are {read.tilt:.4g} rad off y; y is taken, so that "
            "wheels move up and down without moving sideways"
        )
    pitch, bogie = read.levelling.pitch, read.levelling.bogie
    if pitch or bogie:
        typer.echo(
            "wheels were not level; on flat ground the URDF's axes have a pitch of "
            f"{pitch:.4g} rad, its bogies an angle of {bogie:.4g} rad"
        )
