# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner warm-up`: compiles all kernels and keeps them on disk."""

import os
from typing import Annotated

import typer


def warm_up(
    processes: Annotated[
        int,
        typer.Option(
            help="Largest number of processes of up to 1 GB each; 0 for one for each processor.",
            min=0,
        ),
    ] = 0,
) -> None:
    """Compile all kernels, so that the first start is as fast as others: in an image, a build."""
    from rover_physics.compilation import compile_groups
    from rover_physics.numerics.kernel_cache import can_save_kernels, kernel_folder
    from rover_planner.errors import PlanningError
    from rover_planner.nodes.warm_up import GROUPS
    from rover_planner.shell.progress import show_names

    if not can_save_kernels():
        raise PlanningError(
            f"kernels cannot be kept in {kernel_folder()}: it cannot be written, or is full; set "
            "NUMBA_CACHE_DIR to a folder that can be written, here and for the nodes"
        )
    total = sum(len(group) for group in GROUPS)
    with show_names(total) as report:
        compile_groups(GROUPS, report, processes or os.cpu_count() or 1)
    typer.echo(f"kernels are in {kernel_folder()}")
