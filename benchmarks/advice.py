# SPDX-License-Identifier: Apache-2.0
"""Advice on refused paths of real and made maps: is it valid, least, and in time?

Run from the repository: python -m benchmarks.advice FILE [--paths N] [--drives N] [--pairs N]
The file gets a line of JSON for each path; lines that it has are kept. The drives in MuJoCo need
the extra `bench`.
"""

import json
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.chance_drives import arrives
from benchmarks.grounds import all_grounds, made_reef, real_maps
from benchmarks.measure import console
from rover_physics import Terrain, judge_path, load_rover
from rover_physics.names import EQUAL, SERVO
from rover_physics.prediction.sweep_options import SweepOptions
from rover_planner.advice.advise import Advice, grow_within
from rover_planner.advice.case import Case
from rover_planner.advice.levers import LEVERS, Lever, Span
from rover_planner.advice.refusal import Refusal
from rover_planner.advice.remedy import Remedy
from rover_planner.advice.seek import can_combine
from rover_planner.nodes.warm_up import search_paths
from rover_planner.planning.answering.budget import Budget

LENGTHS = {"lsr1": 4.0, "m2020": 10.0}
"""Length of the paths [m] by rover."""
SPACING = 0.05
"""Distance of their waypoints [m]."""
GRID, PAIRS_GRID = 100, 5
"""Values of a lever, to each side, that the exhaustive search tries: alone, and in a pair."""
SPEED = 0.06
"""Speed of the drives [m/s]."""

Row = dict[str, Any]
"""What came of a path."""


def draw_case(grounds: dict[str, Terrain], number: int) -> tuple[str, Case]:
    """Return a straight path that begins well and is refused further on, and its ground's name."""
    rng, names = np.random.default_rng(number), list(grounds)
    while True:
        name, place = rng.choice(list(LENGTHS)), names[rng.integers(len(grounds))]
        ground = grounds[place]
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
            return place, case


def advise_on(case: Case, budget: float, drives: bool) -> Row:
    """Return what comes of advice within a CPU time [s]; a remedy is driven if there is one."""
    began, first, advice = time.process_time(), None, None
    for advice in grow_within(case, Budget(budget, time.process_time).check):
        if advice.found and first is None:
            first = time.process_time() - began
    total = time.process_time() - began
    assert advice is not None
    remedies = advice.remedies
    driven = next(filter(can_be_driven, remedies), None) if drives else None
    return {
        "rover": case.rover.name,
        "policy": case.options.policy,
        "code": advice.judged.verdict.code,
        "complete": advice.complete,
        "first": first,
        "total": total,
        "remedies": [[one.lever.name for one in remedy.levers] for remedy in remedies],
        "own": any(not one.needs_others for one in advice.found),
        "found": len(advice.found),
        "valid": sum(map(is_valid, remedies)),
        "largest_use": max((one.judged.largest_use[0] for one in remedies), default=None),
        "gap": next((gap for gap in map(find_gap, remedies) if gap is not None), None),
        "missed": find_missed(advice) if advice.complete and not advice.found else [],
        "arrives": None if driven is None else drive(driven),
        "words": [one.describe() for one in advice.found],
    }


def is_valid(remedy: Remedy) -> bool:
    """Judge a remedy again by what is told of it."""
    case, told = remedy.refusal.case, remedy.to_dict()
    options = replace(case.options, **told["options"])
    poses = np.array(told.get("poses", case.poses))
    return judge_path(case.rover, case.terrain, poses, options)[1].traversable


def find_gap(remedy: Remedy) -> float | None:
    """Return by how much a single lever is set too far [share of its range], by all values."""
    (one, *others) = remedy.levers
    span = one.lever.settings(remedy.refusal)
    if others or not isinstance(span, Span):
        return None
    end = max(span.ends, key=lambda end: (end - span.now) * (one.value - span.now))
    for k in range(1, GRID):
        value = span.now + k / GRID * (end - span.now)
        if abs(value - span.now) >= abs(one.value - span.now):
            break
        case = one.lever.apply(remedy.refusal.case, remedy.refusal, value)
        if case is not None and case.judge().passes:
            return float(abs(one.value - value) / abs(end - span.now))
    return 0.0


def find_missed(advice: Advice) -> list[str]:
    """Return the rover's own levers that help alone by some value though none was found to."""
    refusal = Refusal(advice.judged)
    return [one.name for one in _own_levers(refusal) if _help([one], refusal, GRID)]


def find_missed_pairs(case: Case) -> list[str]:
    """Return pairs of the rover's own levers that help together, of a path that none helps."""
    refusal = Refusal(case.judge())
    pairs = filter(can_combine, combinations(_own_levers(refusal), 2))
    return [" + ".join(one.name for one in pair) for pair in pairs
            if _help(pair, refusal, PAIRS_GRID)]  # fmt: skip


def _own_levers(refusal: Refusal) -> list[Lever]:
    return [one for one in LEVERS if not one.needs_others and one.settings(refusal) is not None]


def _help(levers: Sequence[Lever], refusal: Refusal, count: int) -> bool:
    """Return whether a path passes with levers set to any of their values."""
    for values in product(*(_values(one, refusal, count) for one in levers)):
        case: Case | None = refusal.case
        for lever, value in zip(levers, values, strict=True):
            case = None if case is None else lever.apply(case, refusal, value)
        if case is not None and case.judge().passes:
            return True
    return False


def _values(lever: Lever, refusal: Refusal, count: int) -> Iterator[Any]:
    """Yield the values of a lever, of a range `count` to each side."""
    settings = lever.settings(refusal)
    assert settings is not None
    if not isinstance(settings, Span):
        yield from settings.values
        return
    for end in settings.ends:
        yield from settings.now + np.arange(1, count + 1) / count * (end - settings.now)


def can_be_driven(remedy: Remedy) -> bool:
    """Return whether a remedy is one of the LSR-1 with speed servos, arm and motors as told."""
    case, known = remedy.judged.case, {"policy", "friction"}
    is_known = case.rover.name == "lsr1" and set(remedy.options()) <= known
    return is_known and case.options.policy == SERVO


def drive(remedy: Remedy) -> bool:
    """Drive a remedy in MuJoCo; return whether the rover arrives."""
    case = remedy.judged.case
    assert case.options.friction is not None
    rover = replace(case.rover, nominal_speed=SPEED)
    return arrives(rover, case.terrain, case.poses, case.options.friction)


def report(rows: list[Row]) -> None:
    """Print what came of all paths."""
    say, counts = console().print, Counter(name for row in rows for one in row["remedies"]
                                           for name in one)  # fmt: skip
    remedies = sum(len(row["remedies"]) for row in rows)
    gaps = [row["gap"] for row in rows if row["gap"] is not None]
    none = [row["missed"] for row in rows if row["complete"] and not row["found"]]
    driven = [row["arrives"] for row in rows if row["arrives"] is not None]
    say(f"{len(rows)} refused paths; all levers tried on {sum(row['complete'] for row in rows)}")
    say(f"with a remedy of the rover's own: {sum(row['own'] for row in rows)}; with any: "
        f"{sum(row['found'] > 0 for row in rows)}")  # fmt: skip
    say(f"valid by predict: {sum(row['valid'] for row in rows)} of {remedies}")
    say(f"gap to the least value, of {len(gaps)}: median {np.median(gaps):.3f}, 95 % "
        f"{np.percentile(gaps, 95):.3f} of the range")  # fmt: skip
    say(f"no lever helps: {len(none)}; one of them alone does after all: "
        f"{sum(bool(one) for one in none)}")  # fmt: skip
    pairs = [row["missed_pairs"] for row in rows if "missed_pairs" in row]
    say(f"of {len(pairs)} of them tried with two levers: {sum(bool(one) for one in pairs)} pass")
    for ground, rover in sorted({(row["ground"], row["rover"]) for row in rows}):
        here = [row for row in rows if (row["ground"], row["rover"]) == (ground, rover)]
        first = [row["first"] for row in here if row["first"] is not None] or [np.nan]
        total = np.percentile([row["total"] for row in here], (50, 90))
        say(
            f"{ground}, {rover}, {len(here)} paths: CPU time to the first remedy "
            f"{np.median(first):.2f} s; all trials {total[0]:.1f} s, 90 % {total[1]:.1f} s"
        )
    for name, times in {
        "the first remedy": [row["first"] for row in rows if row["first"] is not None],
        "all trials, with a remedy": [row["total"] for row in rows if row["own"]],
        "all trials, without": [row["total"] for row in rows if not row["own"]],
    }.items():
        quantiles = np.percentile(times, (50, 90)) if times else (np.nan, np.nan)
        say(f"CPU time to {name}: median {quantiles[0]:.2f} s, 90 % {quantiles[1]:.2f} s")
    say(", ".join(f"{name} {count}" for name, count in counts.most_common()))
    say(f"driven in MuJoCo: {sum(driven)} of {len(driven)} arrive")


def main(
    file: Annotated[Path, typer.Argument(help="File of the paths.")],
    paths: Annotated[int, typer.Option(help="Number of refused paths.")] = 200,
    drives: Annotated[int, typer.Option(help="Number of the first paths that are driven.")] = 200,
    budget: Annotated[float, typer.Option(help="CPU time for each path [s].")] = 10.0,
    pairs: Annotated[int, typer.Option(help="Number of hopeless ones tried with pairs.")] = 10,
) -> None:
    """Print what comes of advice on refused paths."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    grounds = dict(list((all_grounds() | real_maps() | {"reef": made_reef()}).items())[1:])
    search_paths()
    for number in range(len(rows), paths):
        ground, case = draw_case(grounds, number)
        row = {"ground": ground, **advise_on(case, budget, number < drives)}
        if row["complete"] and not row["found"] and pairs > 0:
            row["missed_pairs"], pairs = find_missed_pairs(case), pairs - 1
        rows.append(row)
        with file.open("a") as target:
            target.write(json.dumps(row) + "\n")
    report(rows)


if __name__ == "__main__":
    typer.run(main)
