"""The command `rover_planner study`: sweeps or optimises numbers of a rover."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need

if TYPE_CHECKING:
    from rover_planner.studies.runner import StudyResult, Trial
    from rover_planner.studies.study_file import Study


def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file, .yaml.")],
    output: Annotated[Path, typer.Option(help="Folder for table and picture.")] = Path("."),
) -> None:
    """Sweep or optimise numbers of a rover; write a CSV and a picture.

    Exit code 0: it ran. 2: bad input.
    """
    need("matplotlib", "the picture of a study")
    from rover_planner.shell.progress import show_bar
    from rover_planner.studies.runner import count_trials, run_study
    from rover_planner.studies.study_file import load_study
    from rover_planner.studies.study_plot import draw_study

    task = load_study(file)
    _print_question(task, count_trials(task))
    with show_bar(file.stem, count_trials(task)) as advance:
        result = run_study(task, lambda trial: advance())
    try:
        output.mkdir(parents=True, exist_ok=True)
        result.write_csv(output / f"{file.stem}.csv")
    except OSError as error:
        raise PlanningError(f"cannot write into {show_file(output)}: {error.strerror}") from None
    draw_study(result, output / f"{file.stem}.png")
    _print_answer(result)
    typer.echo(f"wrote {output / file.stem}.csv and .png")


def _print_question(task: "Study", count: int) -> None:
    from rover_planner.studies.study_file import OBJECTIVES

    best, what, unit = OBJECTIVES[task.objective]
    most = "at most " if task.method == "optimise" else ""
    typer.echo(f"{task.method} {most}{count} rovers like {task.rover.name} for the {best}")
    typer.echo(f"  {what}, {unit}".rstrip(", "))
    for parameter in task.parameters:
        along = f", with {len(parameter.also)} more" if parameter.also else ""
        typer.echo(
            f"  {parameter.name}: {parameter.low:g} to {parameter.high:g} {parameter.unit}, "
            f"now {parameter.now:g}{along}"
        )


def _print_answer(result: "StudyResult") -> None:
    failed = [trial for trial in result.trials if trial.objective != trial.objective]
    if failed:
        typer.echo(f"{len(failed)} rovers cannot be judged; the first: {failed[0].note}")
    _print_trial("as it is", result.baseline, result)
    _print_trial("best", result.best, result)


def _print_trial(name: str, trial: "Trial", result: "StudyResult") -> None:
    from rover_planner.studies.study_file import OBJECTIVES

    _, what, unit = OBJECTIVES[result.study.objective]
    typer.echo(f"{name}:")
    for parameter, value in zip(result.study.parameters, trial.values, strict=True):
        typer.echo(f"  {parameter.name} = {value:.4g} {parameter.unit}".rstrip())
    typer.echo(f"  {what}: {trial.objective:.6g} {unit}".rstrip())
    rear, middle, front = (sum(trial.load_shares[k::3]) / 2.0 for k in range(3))
    typer.echo(
        f"  load shares on level ground: rear {rear:.4f} middle {middle:.4f} front {front:.4f}"
    )
    if trial.note:
        typer.echo(f"  {trial.note}")
