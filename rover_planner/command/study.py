# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner study`: sweeps or optimises numbers of a rover."""

from pathlib import Path
from typing import Annotated

import typer

from rover_physics.files.validation import show_file
from rover_planner.command.shared import argument
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need


def study(
    file: Annotated[Path, argument("STUDY", "Study file, .yaml, or the name of an example.")],
    output: Annotated[Path, typer.Option(help="Folder for table, picture and rover.")] = Path("."),
) -> None:
    """Sweep or optimise numbers of a rover; write a CSV, a picture and the best rover's file.

    Exit code 0: it ran. 2: bad input.
    """
    need("matplotlib", "the picture of a study")
    from rover_planner.figures.study_plot import draw_study
    from rover_planner.shell.progress import show_bar
    from rover_planner.studies.rover_values import write_rover
    from rover_planner.studies.runner import (
        count_trials,
        describe_question,
        describe_result,
        find_rover,
        run_study,
    )
    from rover_planner.studies.study_file import find_examples, load_study

    task = load_study(find_examples().get(str(file), file))
    typer.echo("\n".join(describe_question(task)))
    with show_bar(file.stem, count_trials(task)) as advance:
        result = run_study(task, lambda trial: advance())
    try:
        output.mkdir(parents=True, exist_ok=True)
        result.write_csv(output / f"{file.stem}.csv")
        best = write_rover(find_rover(task, result.best.values))
        (output / f"{file.stem}_best.yaml").write_text(best, encoding="utf-8")
    except OSError as error:
        raise PlanningError(f"cannot write into {show_file(output)}: {error.strerror}") from None
    draw_study(result, output / f"{file.stem}.png")
    typer.echo("\n".join(describe_result(result)))
    typer.echo(f"wrote {output / file.stem}.csv and .png, and {file.stem}_best.yaml")
