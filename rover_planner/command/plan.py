# SPDX-License-Identifier: Apache-2.0
"""The commands `rover_planner plan` and `replay-plan`: search a path between two poses."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_physics.rover.uncertainty import ACCEPTED_CHANCE, SIGMAS
from rover_planner.command import shared
from rover_planner.command.shared import argument, flag, option, picture_option
from rover_planner.shell.poses import GOAL, START, Pose

if TYPE_CHECKING:
    from rover_planner.planning.search.query import LatticeSettings, SearchQuery

Out = Annotated[Path, argument("OUT", "The path with its predictions, .npz; written if found.")]
Picture = Annotated[Path | None, picture_option("Draw the answer on the map (.png, .svg).")]


def plan(
    rover: shared.RoverName,
    terrain: shared.TerrainName,
    out: Out,
    start: Annotated[Pose, START],
    goal: Annotated[Pose, GOAL],
    policy: shared.Policy = "equal",
    friction: shared.Friction = None,
    max_torque: shared.MaxTorque = None,
    soil: shared.SoilName = None,
    payload: shared.Payload = None,
    budget: Annotated[
        float, option("S", "Time for the search in s; smoothing takes up to a fifth more.")
    ] = 2.0,
    cell: Annotated[
        float | None,
        option("M", "Distance of the lattice's nodes in m; default: a quarter of the wheelbase."),
    ] = None,
    frontier: Annotated[
        bool,
        flag("--frontier", "Plan as near as possible to a goal on unknown ground or off the map."),
    ] = False,
    sigmas: shared.Sigmas = SIGMAS,
    accepted_chance: shared.AcceptedChance = ACCEPTED_CHANCE,
    chance_weight: Annotated[
        float, option("M", "Length in m that a path may be longer to fail never, not always.")
    ] = 0.0,
    picture: Picture = None,
    dump: Annotated[
        Path | None, option("FILE", "Write the question for replay-plan, .npz.")
    ] = None,
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> None:
    """Search a path around obstacles; write it with its predictions, and print a report as JSON.

    Exit code 0: it ran, with any answer. 2: bad input.
    """
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain
    from rover_planner.planning.path_query import PathQueryOptions
    from rover_planner.planning.search.query import (
        LatticeSettings,
        SearchQuery,
        Site,
        write_query,
    )

    shared.keep_inputs((rover, terrain), out, dump, picture)
    settings = LatticeSettings(
        budget=budget, cell=cell, frontier=frontier, chance_weight=chance_weight
    )
    options = PathQueryOptions(
        model=SweepOptions(
            policy=policy, friction=friction, max_torque=max_torque, soil=soil, payload=payload
        ),
        map_sigmas=sigmas,
        accepted_chance=accepted_chance,
    )
    site = Site(load_rover(rover), load_terrain(terrain, max_cells), options)
    question = SearchQuery(site, start, goal)
    if dump is not None:
        write_query(dump, question, settings)
    _ask(question, settings, out, picture, Path(terrain).name)


def replay_plan(
    question: Annotated[Path, argument("QUESTION", "Question that plan --dump has written.")],
    out: Out,
    picture: Picture = None,
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> None:
    """Search the path of a question again that `plan --dump` has written."""
    from rover_planner.planning.search.query import read_query

    shared.keep_inputs((question,), out, picture)
    asked, settings = read_query(question, max_cells)
    _ask(asked, settings, out, picture, f"the map of {question.name}")


def _ask(
    question: "SearchQuery",
    settings: "LatticeSettings",
    out: Path,
    picture: Path | None,
    map_name: str,
) -> None:
    """Search the path, write it and print the report."""
    from rover_planner.command.prediction_files import write_prediction
    from rover_planner.nodes.warm_up import prepare_search
    from rover_planner.planning.path_query import assume
    from rover_planner.planning.search.path_search import find_path
    from rover_planner.shell.progress import show_progress

    with show_progress() as progress:
        progress("load the model (the first run compiles it)")
        prepare_search(question.site)
        progress(f"search a path for {question.site.rover.name}")
        answer = find_path(question, settings)
    if answer.path is not None:
        site = question.site
        assumed = assume(site.rover, site.options.model, site.options.map_sigmas)
        write_prediction(out, answer.path.prediction, answer.path.verdict, assumptions=assumed)
    if picture is not None:
        from rover_planner.figures.path_pictures import draw_path

        draw_path(picture, question, answer, map_name)
    if answer.warning:
        typer.echo(f"warning: {answer.warning}", err=True)
    typer.echo(json.dumps(answer.report(), allow_nan=False))
