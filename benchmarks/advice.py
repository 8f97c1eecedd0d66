# SPDX-License-Identifier: Apache-2.0
"""Advice on refused paths of real and made maps: is it valid, least, and in time?

Run from the repository: python -m benchmarks.advice [--paths N] [--drives N]
The drives in MuJoCo need the extra `bench`.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Annotated

import numpy as np
import typer

from benchmarks.chance_drives import arrives
from benchmarks.drives import run_in_processes
from benchmarks.grounds import all_grounds, made_reef, real_maps
from benchmarks.measure import console
from rover_physics import Rover, Terrain, judge_path, load_rover
from rover_physics.names import EQUAL, SERVO
from rover_physics.prediction.sweep_options import SweepOptions
from rover_planner.advice.advise import Advice, grow_within
from rover_planner.advice.case import Case
from rover_planner.advice.levers import LEVERS, Span
from rover_planner.advice.refusal import Refusal
from rover_planner.advice.remedy import Remedy
from rover_planner.planning.answering.budget import Budget

LENGTHS = {"lsr1": 4.0, "m2020": 10.0}
"""Length of the paths [m] by rover."""
SPACING = 0.05
"""Distance of their waypoints [m]."""
GRID = 100
"""Values of a lever that the exhaustive search tries."""
SPEED = 0.06
"""Speed of the drives [m/s]."""


@dataclass(frozen=True, eq=False)
class Advised:
    """A refused path and the advice on it."""

    advice: Advice
    """The advice."""
    first: float
    """CPU time until the first remedy [s]; NaN if there is none."""
    total: float
    """CPU time of all trials [s]."""


def draw_cases(rng: np.random.Generator) -> Iterator[Case]:
    """Yield straight paths at random places that begin well and are refused further on."""
    grounds = [*all_grounds().values(), *real_maps().values(), made_reef()][1:]
    while True:
        name, ground = rng.choice(list(LENGTHS)), grounds[rng.integers(len(grounds))]
        s = np.arange(0.0, LENGTHS[name], SPACING)
        xmin, xmax, ymin, ymax = ground.bounds
        x, y, yaw = rng.uniform((xmin, ymin, -np.pi), (xmax, ymax, np.pi))
        poses = np.column_stack([x + s * np.cos(yaw), y + s * np.sin(yaw), np.full_like(s, yaw)])
        options = SweepOptions(
            policy=str(rng.choice([EQUAL, SERVO])), friction=float(rng.uniform(0.4, 0.9))
        )
        case = Case(load_rover(str(name)), replace(ground, friction=None), poses, options)
        verdict = case.judge().verdict
        starts_well = verdict.first_failure > 1.0 / SPACING
        if starts_well and verdict.code not in ("off_map", "unknown_ground"):
            yield case


def advise_timed(case: Case, budget: float) -> Advised:
    """Seek advice within a time [s]."""
    began, first, advice = time.process_time(), float("nan"), None
    for advice in grow_within(case, Budget(budget, time.process_time).check):
        if advice.found and np.isnan(first):
            first = time.process_time() - began
    assert advice is not None
    return Advised(advice, first, time.process_time() - began)


def is_valid(remedy: Remedy) -> bool:
    """Judge a remedy again by what is told of it."""
    case, told = remedy.refusal.case, remedy.to_dict()
    options = replace(case.options, **told["options"])
    poses = np.array(told.get("poses", case.poses))
    return judge_path(case.rover, case.terrain, poses, options)[1].traversable


def find_gap(remedy: Remedy) -> float | None:
    """Return by how much a single lever is set too far [share of its range], by all values."""
    if len(remedy.levers) > 1:
        return None
    (one,) = remedy.levers
    span = one.lever.settings(remedy.refusal)
    if not isinstance(span, Span):
        return None
    end = max(span.ends, key=lambda end: (end - span.now) * (one.value - span.now))
    for k in range(1, GRID):
        value = span.now + k / GRID * (end - span.now)
        if abs(value - span.now) >= abs(one.value - span.now):
            return 0.0
        case = one.lever.apply(remedy.refusal.case, remedy.refusal, value)
        if case is not None and case.judge().passes:
            return abs(one.value - value) / abs(end - span.now)
    return 0.0


def is_missed(advice: Advice) -> bool:
    """Return whether a single lever helps by some value though none was found to."""
    refusal = Refusal(advice.judged)
    for lever in LEVERS:
        settings = lever.settings(refusal)
        if lever.needs_others or settings is None:
            continue
        ends = settings.ends if isinstance(settings, Span) else settings.values
        for end in ends:
            for k in range(1, GRID + 1) if isinstance(settings, Span) else (GRID,):
                value = settings.now + k / GRID * (end - settings.now) if k < GRID else end
                case = lever.apply(refusal.case, refusal, value)
                if case is not None and case.judge().passes:
                    return True
    return False


def job_of(remedy: Remedy) -> tuple[Rover, Terrain, np.ndarray, float]:
    """Return what `arrives` takes to drive a remedy with speed servos."""
    case = remedy.judged.case
    friction = case.options.friction
    assert friction is not None
    rover = replace(case.rover, nominal_speed=SPEED)
    return rover, case.terrain, case.poses, friction


def can_be_driven(remedy: Remedy) -> bool:
    """Return whether a remedy is one of the LSR-1 with speed servos, arm and motors as told."""
    case, known = remedy.judged.case, {"policy", "friction"}
    is_known = case.rover.name == "lsr1" and set(remedy.options()) <= known
    return is_known and case.options.policy == SERVO and remedy.is_option


def main(
    paths: Annotated[int, typer.Option(help="Number of refused paths.")] = 200,
    drive_count: Annotated[int, typer.Option("--drives", help="Number of drives.")] = 40,
    budget: Annotated[float, typer.Option(help="CPU time for each path [s].")] = 20.0,
    seed: Annotated[int, typer.Option(help="Seed of the paths.")] = 1,
) -> None:
    """Print what comes of advice on refused paths."""
    cases = islice(draw_cases(np.random.default_rng(seed)), paths)
    advised = [advise_timed(case, budget) for case in cases]
    remedies = [one for found in advised for one in found.advice.remedies]
    own = [any(not one.needs_others for one in found.advice.found) for found in advised]
    complete = [found.advice.complete for found in advised]
    gaps = [gap for gap in map(find_gap, remedies) if gap is not None]
    none = [found.advice for found in advised if found.advice.complete and not found.advice.found]
    missed = sum(map(is_missed, none))
    say = console().print
    say(f"{paths} refused paths, {len(remedies)} remedies; all levers tried on {sum(complete)}")
    say(f"with a remedy of the rover's own: {sum(own)}; with any: "
        f"{sum(bool(found.advice.found) for found in advised)}")  # fmt: skip
    say(f"valid by predict: {sum(map(is_valid, remedies))} of {len(remedies)}")
    say(f"gap to the least value, of {len(gaps)}: median {np.median(gaps):.3f}, 95 % "
        f"{np.percentile(gaps, 95):.3f} of the range")  # fmt: skip
    say(f"no lever helps: {len(none)}; one of them alone does after all: {missed}")
    say(f"CPU time to the first remedy: median {np.nanmedian([f.first for f in advised]):.2f} s; "
        f"of all trials: median {np.median([f.total for f in advised]):.2f} s")  # fmt: skip
    for lever in LEVERS:
        count = sum(any(one.lever is lever for one in remedy.levers) for remedy in remedies)
        say(f"  {lever.name}: {count}")
    driven = list(islice(filter(can_be_driven, remedies), drive_count))
    arrived = list(run_in_processes(arrives, [job_of(one) for one in driven], None))
    say(f"driven in MuJoCo: {sum(arrived)} of {len(driven)} arrive")


if __name__ == "__main__":
    typer.run(main)
