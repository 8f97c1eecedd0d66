# SPDX-License-Identifier: Apache-2.0
"""Describes a study and its result in lines of text, for the terminal and for the page."""

from rover_planner.studies.runner import StudyResult, Trial, count_trials
from rover_planner.studies.study_file import OBJECTIVES, Study, name_thing

MAX_NAMED = 6
"""Most equally good rovers that are named one by one."""


def describe_question(study: Study) -> list[str]:
    """Return what a study asks, and within which bounds."""
    best, what, unit = OBJECTIVES[study.objective]
    count = f"{'at most ' if study.method == 'optimise' else ''}{count_trials(study)}"
    lines = [
        f"{study.method} {count} rovers like {study.rover.name} for the {best}",
        f"  {what}, {unit}".rstrip(", "),
    ]
    for parameter in study.parameters:
        along = f", with {len(parameter.also)} more" if parameter.also else ""
        lines.append(
            f"  {parameter.name}: {parameter.low:g} to {parameter.high:g} {parameter.unit}, "
            f"now {parameter.now:g}{along}"
        )
    return lines


def describe_result(result: StudyResult) -> list[str]:
    """Return the rover as it is and the best one, and how many could not be judged.

    Raises:
        PlanningError: No trial could be judged.
    """
    failed = [trial for trial in result.trials if trial.objective != trial.objective]
    lines = []
    if failed:
        lines.append(f"{len(failed)} rovers cannot be judged; the first: {failed[0].note}")
    lines += _describe_trial("as it is", result.baseline, result.study)
    lines += _describe_trial("best", result.best, result.study)
    return [*lines, tie] if (tie := describe_ties(result)) else lines


def describe_ties(result: StudyResult) -> str:
    """Return which other rovers are as good as the best; empty if there are none.

    Raises:
        PlanningError: No trial could be judged.
    """
    ties, study = result.ties, result.study
    if not ties:
        return ""
    unit = OBJECTIVES[study.objective][2]
    within = f" within {study.resolution:g} {unit}".rstrip() if study.resolution else ""
    if len(ties) > MAX_NAMED or len(study.parameters) > 1:
        return f"as good{within}: {len(ties)} others"
    parameter = study.parameters[0]
    values = ", ".join(f"{trial.values[0]:.4g}" for trial in ties)
    return f"as good{within}: {name_thing(parameter.name)} {values} {parameter.unit}".rstrip()


def _describe_trial(name: str, trial: Trial, study: Study) -> list[str]:
    _, what, unit = OBJECTIVES[study.objective]
    lines = [f"{name}:"]
    for parameter, value in zip(study.parameters, trial.values, strict=True):
        lines.append(f"  {parameter.name} = {value:.4g} {parameter.unit}".rstrip())
    rear, middle, front = (sum(trial.load_shares[k::3]) / 2.0 for k in range(3))
    lines += [
        f"  {what}: {trial.objective:.6g} {unit}".rstrip(),
        f"  load shares on level ground: rear {rear:.4f} middle {middle:.4f} front {front:.4f}",
    ]
    return [*lines, f"  {trial.note}"] if trial.note else lines
