# SPDX-License-Identifier: Apache-2.0
"""The commands `survey` and `reachable`: where on a map a rover passes, and where it can get."""

import json
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_physics.rover.uncertainty import SIGMAS
from rover_planner.command import shared
from rover_planner.command.shared import argument, flag, option, picture_option
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need
from rover_planner.shell.poses import read_numbers
from rover_planner.shell.run_program import EXIT_FAILED, EXIT_OK, end_as_by_ctrl_c, end_with

if TYPE_CHECKING:
    from rover_planner.survey.dask_cluster import ClusterSettings
    from rover_planner.survey.runner import SurveyOutcome
    from rover_planner.survey.survey import PreparedSurvey


def survey(
    rover: shared.RoverName,
    map_name: Annotated[
        str, argument("MAP", "Preset (spirit), elevation map, .npz, or GeoTIFF, .tif.")
    ],
    out: Annotated[Path, argument("OUT", "Zarr store; goes on with one of the same survey.")],
    headings: Annotated[int, option("N", "Number of headings, 1 to 64.")] = 16,
    step: Annotated[int, option("CELLS", "Distance of surveyed cells in map cells.")] = 1,
    policy: shared.Policy = "equal",
    friction: shared.Friction = None,
    turns: Annotated[
        bool, flag("--turns", "Judge turns on the spot, too; takes up to 3 x.")
    ] = False,
    chance: Annotated[
        bool, flag("--chance", "Find the chances of failure, too; takes up to 30 x.")
    ] = False,
    sigmas: shared.Sigmas = SIGMAS,
    max_gap: shared.MaxGap = 0.0,
    scheduler: Annotated[
        str | None, option("ADDRESS", "Dask scheduler, tcp://...; default: this machine's cores.")
    ] = None,
    workers: Annotated[
        int | None,
        option(
            "N",
            "Worker processes on this machine, without --scheduler; default: one a processor.",
            min=1,
        ),
    ] = None,
    memory_limit: Annotated[
        str | None,
        option("SIZE", "Memory of a worker, such as 1GiB; default: its share of the machine's."),
    ] = None,
    chunk: Annotated[
        int | None,
        option("CELLS", "Side of a chunk in surveyed cells; default: some seconds of work."),
    ] = None,
    geotiff: Annotated[
        Path | None, option("FOLDER", "Write each layer as GeoTIFF (COG), too.")
    ] = None,
    picture: Annotated[Path | None, picture_option("Draw the classes on the map, .png.")] = None,
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> int:
    """Judge a rover at all cells of a map and all headings; write the results to a Zarr store.

    Exit code 0: it ran. 1: some chunks failed, the rest stands. 2: bad input.
    """
    for module in ("distributed", "zarr"):
        need(module, "a survey")
    if geotiff is not None or Path(map_name).suffix.lower() in (".tif", ".tiff"):
        need("rasterio", "a GeoTIFF")
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_planner.survey.cog import make_folder, write_layers
    from rover_planner.survey.dask_cluster import ClusterSettings, check_settings
    from rover_planner.survey.request import SurveyRequest
    from rover_planner.survey.survey import prepare_survey

    settings = ClusterSettings(scheduler, workers, memory_limit)
    check_settings(settings)
    request = SurveyRequest(
        load_rover(rover),
        SweepOptions(policy=policy, friction=friction),
        headings=headings,
        step=step,
        turns=turns,
        chance=chance,
        sigmas=sigmas,
    )
    if geotiff is not None:  # before hours of work
        make_folder(geotiff)
    with end_as_by_ctrl_c():
        prepared = prepare_survey(request, map_name, out, chunk, max_cells, max_gap, settings)
        began = time.monotonic()
        outcome = _run(prepared, settings)
    if geotiff is not None:
        write_layers(prepared.store, geotiff)
    if picture is not None:
        from rover_planner.figures.survey_picture import draw_survey

        draw_survey(picture, prepared.store)
    return _tell(prepared, outcome, time.monotonic() - began)


def _run(prepared: "PreparedSurvey", settings: "ClusterSettings") -> "SurveyOutcome":
    """Survey what is not finished; a store that is may be read-only."""
    from rover_planner.shell.progress import show_bar, show_progress
    from rover_planner.survey.runner import SurveyOutcome, run_survey
    from rover_planner.survey.tile_survey import warm_up_survey

    if not prepared.chunks:
        return SurveyOutcome()
    job, total = prepared.job, 0
    for rows, columns in map(prepared.store.notes.layout.cells_of, prepared.chunks):
        cells = (rows.stop - rows.start) * (columns.stop - columns.start)
        total += cells * job.request.headings
    with prepared.store.locked():
        with show_progress() as progress:
            progress("load the model (the first run compiles it)")
            warm_up_survey(job.request)
        with show_bar("survey", total, "poses") as advance:
            return run_survey(job, prepared.chunks, settings, advance)


def _tell(prepared: "PreparedSurvey", outcome: "SurveyOutcome", seconds: float) -> int:
    """Print what became of a survey in a time [s]; return the exit code."""
    from rover_planner.survey.survey import summarise

    report = {
        "out": str(prepared.store.path),
        **summarise(prepared.store),
        "chunks": prepared.finished + len(prepared.chunks),
        "chunks_found": prepared.finished,
        "chunks_done": outcome.done,
        "chunks_failed": [list(chunk) for chunk in outcome.failed],
        "poses": outcome.poses,
        "seconds": round(seconds, 3),
        "poses_per_second": round(outcome.poses / seconds, 1) if seconds > 0.0 else None,
    }
    typer.echo(json.dumps(report))
    if not outcome.failed:
        return EXIT_OK
    names = ", ".join(f"[{i}, {j}]" for i, j in list(outcome.failed)[:5])
    more = f" and {len(outcome.failed) - 5} more" if len(outcome.failed) > 5 else ""
    why = next(iter(outcome.failed.values()))
    return end_with("rover_planner", EXIT_FAILED, f"chunks {names}{more} failed: {why}")


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
