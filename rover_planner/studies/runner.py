# SPDX-License-Identifier: Apache-2.0
"""Runs a study, all of a sweep or an optimisation by scipy, and tells in words what came of it."""

import contextlib
import csv
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_physics.errors import ModelError, RoverFileError
from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.studies.objectives import evaluate, level_loads
from rover_planner.studies.rover_values import vary
from rover_planner.studies.study_file import OBJECTIVES, Study, label_of, name_thing

MAX_NAMED = 6
"""Most equally good rovers that are named one by one."""
SEED = 1
"""Seed of the optimisation."""
ALL_OVER = 0.6
"""Share of evaluations in the global phase of an optimisation; the rest is the local phase."""
NEAR = -0.05
"""Initial steps of the local phase, in widths of the bounds."""
IMPOSSIBLE = 1e6
"""Cost of a rover that cannot be judged, for the optimiser."""


@dataclass(frozen=True)
class Trial:
    """One rover that was tried."""

    values: tuple[float, ...]
    """Values of the parameters, in their order."""
    objective: float
    """Value of the objective; NaN if the rover is invalid or cannot be judged."""
    note: str
    """Reason for NaN, or the drive that determines the value."""
    load_shares: tuple[float, ...] = (float("nan"),) * 6
    """Shares of the weight on level ground, wheel order; NaN if the rover cannot stand."""


@dataclass(frozen=True)
class StudyResult:
    """All trials of a study."""

    study: Study
    """The study."""
    baseline: Trial
    """The unchanged rover of the file."""
    trials: tuple[Trial, ...]
    """The trials in order."""

    @property
    def best(self) -> Trial:
        """The trial with the best objective; of equal ones the middle one.

        Raises:
            PlanningError: No trial could be judged.
        """
        known = [trial for trial in self.trials if np.isfinite(trial.objective)]
        if not known:
            raise PlanningError(f"no rover of the study could be judged: {self.trials[0].note}")
        choose = max if self.study.wants_largest else min
        best = choose(trial.objective for trial in known)
        equals = [trial for trial in known if abs(trial.objective - best) <= 1e-9 * abs(best)]
        return sorted(equals, key=lambda trial: trial.values)[len(equals) // 2]

    @property
    def ties(self) -> tuple[Trial, ...]:
        """The other trials of a sweep that are as good as the best within the resolution.

        They are sorted by their values. An optimisation has none: it ends where all are equal.

        Raises:
            PlanningError: No trial could be judged.
        """
        if self.study.method == "optimise":
            return ()
        best = self.best
        most = max(self.study.resolution, 1e-9 * abs(best.objective))
        near = [t for t in self.trials if abs(t.objective - best.objective) <= most]
        return tuple(sorted((t for t in near if t.values != best.values), key=lambda t: t.values))

    def write_csv(self, path: Path) -> None:
        """Write a CSV file with a row for each trial."""
        _, what, unit = OBJECTIVES[self.study.objective]
        heads = [label_of(p.name, p.unit) for p in self.study.parameters]
        heads += [label_of(what, unit), *(f"load share {wheel}" for wheel in WHEELS), "note"]
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(heads)
            for trial in self.trials:
                shares = [f"{share:.6f}" for share in trial.load_shares]
                numbers = [f"{number:.9g}" for number in (*trial.values, trial.objective)]
                writer.writerow([*numbers, *shares, trial.note])


def count_trials(study: Study) -> int:
    """Return the number of trials of a study; for an optimisation the maximum."""
    if study.method == "optimise":
        return study.evaluations
    return int(np.prod([parameter.count for parameter in study.parameters]))


def run_study(study: Study, on_trial: Callable[[Trial], None] | None = None) -> StudyResult:
    """Run all trials of a study.

    Args:
        study: The study.
        on_trial: Called after each trial.
    """
    trials: list[Trial] = []
    baseline = _try(study, tuple(parameter.now for parameter in study.parameters))

    def attempt(values: tuple[float, ...]) -> float:
        trial = _try(study, values)
        trials.append(trial)
        if on_trial is not None:
            on_trial(trial)
        return trial.objective

    if study.method == "sweep":
        axes = [np.linspace(p.low, p.high, p.count).tolist() for p in study.parameters]
        for values in itertools.product(*axes):
            attempt(values)
    else:
        _optimise(study, attempt)
    return StudyResult(study, baseline, tuple(trials))


def find_rover(study: Study, values: tuple[float, ...]) -> Rover:
    """Return the rover with values of the parameters, in their order.

    Raises:
        RoverFileError, ModelError: It is invalid.
    """
    numbers = {
        key: value
        for parameter, value in zip(study.parameters, values, strict=True)
        for key in parameter.keys
    }
    return vary(study.rover, numbers)


def _try(study: Study, values: tuple[float, ...]) -> Trial:
    try:
        rover = find_rover(study, values)
        loads = level_loads(rover)
        objective, note = evaluate(study, rover)
    except (RoverFileError, ModelError) as error:
        return Trial(values, float("nan"), str(error))
    return Trial(values, objective, note, tuple((loads / loads.sum()).tolist()))


class _EnoughError(Exception):
    """The maximum number of trials is reached."""


def _optimise(study: Study, attempt: Callable[[tuple[float, ...]], float]) -> None:
    """Optimise globally by differential evolution, then locally by the Nelder-Mead method.

    Neither needs derivatives, because objectives are not smooth. Sources: Storn and Price, 1997;
    Nelder and Mead, 1965.
    """
    from scipy.optimize import differential_evolution, minimize

    sign = -1.0 if study.wants_largest else 1.0
    bounds = np.array([(p.low, p.high) for p in study.parameters])
    tried: list[tuple[float, Floats]] = []

    def cost(x: Floats, most: int) -> float:
        if len(tried) >= most:
            raise _EnoughError
        value = attempt(tuple(float(number) for number in x))
        tried.append((sign * value if np.isfinite(value) else IMPOSSIBLE, np.array(x)))
        return tried[-1][0]

    with contextlib.suppress(_EnoughError):
        differential_evolution(
            cost, bounds, args=(round(ALL_OVER * study.evaluations),), popsize=5, tol=1e-3,
            seed=SEED, polish=False, maxiter=study.evaluations,
        )  # fmt: skip
    value, best = min(tried, key=lambda pair: pair[0])
    if value >= IMPOSSIBLE:
        return
    steps = np.diag(NEAR * (bounds[:, 1] - bounds[:, 0]))
    simplex = np.vstack([best, best + steps])
    with contextlib.suppress(_EnoughError):
        minimize(
            cost, best, args=(study.evaluations,), method="Nelder-Mead", bounds=bounds,
            options={"initial_simplex": np.clip(simplex, *bounds.T), "xatol": 1e-6, "fatol": 1e-9},
        )  # fmt: skip


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
        bounds = f"{parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip()
        lines.append(f"  {parameter.name}: {bounds}, now {parameter.now:g}{along}")
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
