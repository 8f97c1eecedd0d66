# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner reachable`: where a rover can go on a survey and return from."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from rover_planner.command.shared import argument, option, picture_option
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need
from rover_planner.shell.poses import read_numbers


def reachable(
    store: Annotated[Path, argument("OUT", "Zarr store of a survey.")],
    start: Annotated[str, option("X,Y", "Start in m, in the map's coordinates.", "--from")],
    picture: Annotated[Path | None, picture_option("Draw the area on the map, .png.")] = None,
    geotiff: Annotated[
        Path | None, option("FILE", "Write the length of the paths as GeoTIFF (COG).")
    ] = None,
) -> None:
    """Find the cells that the rover can reach from a place and return from.

    Exit code 0: it ran, with any answer. 2: bad input.
    """
    need("zarr", "a survey")
    if geotiff is not None:
        need("rasterio", "a GeoTIFF")
    place = read_numbers(start, 2)
    if place is None:
        raise PlanningError(f"--from is {start!r}; it must be two numbers: X,Y or X Y")
    from rover_planner.shell.progress import show_progress
    from rover_planner.survey.cog import write_cog
    from rover_planner.survey.reachable import explain_no_area, find_reachable
    from rover_planner.survey.store import SurveyStore

    opened = SurveyStore(store)
    with show_progress() as progress:
        progress("load the survey")
        area = find_reachable(opened, place[0], place[1], report=progress)
    notes, end = opened.notes, None
    if geotiff is not None:
        write_cog(geotiff, area.distance, notes.frame, notes.layout.step)
    if picture is not None:
        from rover_planner.figures.survey_picture import draw_reachable

        draw_reachable(picture, opened, area)
    if area.farthest is not None:
        left, low = notes.frame.origin
        end = [left + area.farthest[1] * notes.cell, low + area.farthest[0] * notes.cell]
    report = {
        "cells": area.cells,
        "reason": "" if area.cells else explain_no_area(opened, area.start),
        "area": round(area.cells * notes.cell**2, 6),
        "cells_without_return": area.reached - area.cells,
        "longest": None if area.longest is None else round(area.longest, 3),
        "farthest": end,
        "turns": "judged" if notes.description["turns"] else "assumed",
        "chunks_missing": math.prod(notes.layout.chunks) - len(opened.find_finished()),
    }
    typer.echo(json.dumps(report))
