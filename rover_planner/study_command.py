"""The command `rover_planner study`: which numbers of a rover are best for what it drives over."""

from pathlib import Path
from typing import Annotated

import typer


def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file, .yaml.")],
    output: Annotated[Path, typer.Option(help="Folder for table and picture.")] = Path("."),
) -> None:
    """Sweep or optimise numbers of a rover; write a CSV and a picture.

    Exit code 0 when it ran; 2 for bad input.
    """
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

    from rover_planner.errors import PlanningError
    from rover_planner.studies.runner import count_trials, run_study
    from rover_planner.studies.study_file import OBJECTIVES, load_study
    from rover_planner.studies.study_plot import draw_study

    task = load_study(file)
    console = Console(stderr=True)
    with Progress(
        *Progress.get_default_columns(), MofNCompleteColumn(), TimeRemainingColumn(),
        console=console, disable=not console.is_terminal,
    ) as progress:  # fmt: skip
        bar = progress.add_task(file.stem, total=count_trials(task))
        result = run_study(task, lambda trial: progress.advance(bar))
    try:
        output.mkdir(parents=True, exist_ok=True)
        result.write_csv(output / f"{file.stem}.csv")
    except OSError as error:
        raise PlanningError(f"cannot write into {output}: {error.strerror}") from None
    draw_study(result, output / f"{file.stem}.png")
    best, (_, what, unit) = result.best, OBJECTIVES[task.objective]
    for parameter, value in zip(task.parameters, best.values, strict=True):
        typer.echo(f"{parameter.name} = {value:.4g} {parameter.unit}".rstrip())
    typer.echo(f"{what}: {best.objective:.4g} {unit}".rstrip())
