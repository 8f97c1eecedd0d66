"""Runs a study: all combinations of a sweep, or an optimisation by scipy."""

import csv
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import RoverFileError
from rover_planner.errors import PlanningError
from rover_planner.studies.objectives import evaluate
from rover_planner.studies.rover_keys import vary
from rover_planner.studies.study_file import OBJECTIVES, Study

Floats = NDArray[np.float64]
SEED = 1


@dataclass(frozen=True)
class Trial:
    """One rover that was tried."""

    values: tuple[float, ...]
    """Of the parameters, in their order."""
    objective: float
    """What it is worth; NaN where there is no such rover or it cannot be told."""
    note: str
    """Why not, empty where it can."""


@dataclass(frozen=True)
class StudyResult:
    """All that was tried."""

    study: Study
    """The study."""
    trials: tuple[Trial, ...]
    """In the order in which they were tried."""

    @property
    def best(self) -> Trial:
        """The trial with the best objective; of equals the middle one.

        Raises:
            PlanningError: None could be told.
        """
        known = [trial for trial in self.trials if np.isfinite(trial.objective)]
        if not known:
            raise PlanningError(f"no rover of the study could be judged: {self.trials[0].note}")
        choose = max if self.study.wants_largest else min
        best = choose(trial.objective for trial in known)
        equals = [trial for trial in known if abs(trial.objective - best) <= 1e-9 * abs(best)]
        return sorted(equals, key=lambda trial: trial.values)[len(equals) // 2]

    def write_csv(self, path: Path) -> None:
        """Write a row for each trial."""
        _, what, unit = OBJECTIVES[self.study.objective]
        heads = [_head(p.name, p.unit) for p in self.study.parameters] + [
            _head(what, unit),
            "note",
        ]
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(heads)
            for trial in self.trials:
                writer.writerow([*trial.values, trial.objective, trial.note])


def _head(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def count_trials(study: Study) -> int:
    """Return how many rovers a study tries, at most for an optimisation."""
    if study.method == "optimise":
        return study.evaluations
    return int(np.prod([parameter.count for parameter in study.parameters]))


def run_study(study: Study, on_trial: Callable[[Trial], None] | None = None) -> StudyResult:
    """Try the rovers of a study.

    Args:
        study: The study.
        on_trial: Called after each trial.
    """
    trials: list[Trial] = []

    def attempt(values: tuple[float, ...]) -> float:
        trial = _try(study, values)
        trials.append(trial)
        if on_trial is not None:
            on_trial(trial)
        return trial.objective

    if study.method == "sweep":
        for values in _combinations(study):
            attempt(values)
    else:
        _optimise(study, attempt)
    return StudyResult(study, tuple(trials))


def _try(study: Study, values: tuple[float, ...]) -> Trial:
    try:
        rover = vary(study.rover, tuple(p.key for p in study.parameters), values)
    except RoverFileError as error:
        return Trial(values, float("nan"), str(error))
    objective = evaluate(study, rover)
    note = "" if np.isfinite(objective) else "it does not settle everywhere on the drives"
    return Trial(values, objective, note)


def _combinations(study: Study) -> Iterator[tuple[float, ...]]:
    axes = [np.linspace(p.low, p.high, p.count).tolist() for p in study.parameters]
    return itertools.product(*axes)


def _optimise(study: Study, attempt: Callable[[tuple[float, ...]], float]) -> None:
    """Search by differential evolution (Storn and Price, 1997): objectives have jumps."""
    from scipy.optimize import differential_evolution

    sign = -1.0 if study.wants_largest else 1.0
    left = study.evaluations

    class Enough(Exception):  # noqa: N818 - it is no error
        pass

    def cost(x: Floats) -> float:
        nonlocal left
        if left <= 0:
            raise Enough
        left -= 1
        value = attempt(tuple(float(number) for number in x))
        return sign * value if np.isfinite(value) else 1e6

    try:
        differential_evolution(
            cost, [(p.low, p.high) for p in study.parameters], popsize=5, tol=1e-3, seed=SEED,
            polish=False, maxiter=study.evaluations,
        )  # fmt: skip
    except Enough:
        return
