"""Searches ways between random poses on real and made maps: the tables of docs/performance.md.

Run from the repository, on one core: taskset -c 0 python -m benchmarks.ways --count 100
"""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from benchmarks.measure import WIDTH, quantile
from benchmarks.way_trials.estimate import check_estimate, rank_difficulty
from benchmarks.way_trials.grounds import Case, Pair, grounds
from benchmarks.way_trials.trial import Trial, same_on_threads, search, try_pair, try_warm
from benchmarks.way_trials.truth import NoTruthError, Truth
from rover_physics.names import EQUAL
from rover_physics.rover.rover_file import load_rover
from rover_planner.planning.ways.way_search import FOUND

Rows = list[dict[str, Any]]
"""One record for each pair."""


def run_case(case: Case, asked: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield what is found of each pair of a ground, and last of the ground as a whole."""
    pairs = case.pairs(asked["count"], asked["seed"])
    search(case, pairs[0], asked["budget"])  # compiles, and reads the code from the disk
    truth = Truth(case) if asked["truth"] else None
    for index, pair in enumerate(pairs):
        trial = try_pair(case, pair, index, asked["budget"])
        yield {**asdict(trial), **compare(case, pair, trial, truth, asked)}
    if asked["nodes"]:
        yield {"ground": case.name, **check_estimate(case, asked["nodes"])}
    if asked["edges"]:
        yield {"ground": case.name, **rank_difficulty(case, asked["edges"])}


def compare(
    case: Case, pair: Pair, trial: Trial, truth: Truth | None, asked: dict[str, Any]
) -> dict[str, Any]:
    """Return what else is asked for of a pair: the best cost, the warm case, OMPL, threads."""
    found: dict[str, Any] = {}
    if truth is not None and trial.pair < asked["truth"]:
        try:
            found["best"] = truth.find(pair, asked["truth_seconds"])
        except NoTruthError:
            found["best"] = np.nan
        found["truth_judged"], found["truth_edges"] = truth.judged, truth.count
    if trial.pair < asked["warm"]:
        answer = try_warm(case, pair, asked["budget"], trial.pair)
        found["warm_outcome"], found["warm_first"] = answer.outcome, answer.seconds_first
    if trial.pair < asked["ompl"]:
        from benchmarks.way_trials.sampling import sample_way

        seconds = asked["ompl_seconds"]
        sampled = sample_way(case, pair, asked["ompl_planner"], seconds, 1 + trial.pair)
        found |= {f"ompl_{name}": value for name, value in asdict(sampled).items()}
    if trial.pair < asked["threads"]:
        found["same_on_threads"] = same_on_threads(case, pair, asked["budget"])
    return found


def tell(values: Sequence[float], digits: int = 2) -> str:
    """Return the median and the 95th percentile of values as text."""
    known = [value for value in values if np.isfinite(value)]
    if not known:
        return "-"
    return f"{quantile(known, 0.5):.{digits}f}; {quantile(known, 0.95):.{digits}f}"


def column(rows: Rows, name: str) -> list[Any]:
    """Return the values of a name in the rows that have it."""
    return [row[name] for row in rows if name in row]


def summarise(rows: Rows) -> Iterator[tuple[str, str]]:
    """Yield the lines of the table for one ground, each a name and a value."""
    trials = [row for row in rows if "outcome" in row]
    outcomes = column(trials, "outcome")
    ways = [row for row in trials if row["outcome"] == FOUND]
    yield "pairs", str(len(trials))
    yield "outcomes", ", ".join(f"{name} {outcomes.count(name)}" for name in sorted({*outcomes}))
    yield "ways that judge_path passes", f"{sum(column(ways, 'passes'))} of {len(ways)}"
    yield "first way [s]: median; 95 %", tell(column(ways, "seconds_first"))
    far = [row for row in ways if row["distance"] > 12.0]
    yield "first way beyond 12 m [s]", f"{tell(column(far, 'seconds_first'))} ({len(far)})"
    yield "whole search [s]", tell(column(trials, "seconds"))
    yield "judged edges [%]: median; 95 %", tell([100 * v for v in column(trials, "judged_share")])
    yield "judged edges [%]: mean", f"{100 * np.mean(column(trials, 'judged_share')):.3f}"
    yield "bound: median; 95 %", tell(column(ways, "bound"))
    yield "not ended by the clock", f"{sum(column(trials, 'repeatable'))} of {len(trials)}"
    yield from summarise_comparisons(trials)
    for row in rows:
        if "checked" in row:
            yield "nodes refused by the cheap test", f"{100 * row['share']:.1f} %"
            yield "of these the model passes", f"{row['wrong']} of {row['checked']:,}"
        if "rank" in row:
            yield "random edges refused", f"{row['refused']} of {row['ranked']:,}"
            yield "of more difficulty than those that pass", f"{100 * row['rank']:.0f} %"


def summarise_comparisons(trials: Rows) -> Iterator[tuple[str, str]]:
    """Yield the lines about the best of the lattice, the warm case, OMPL and threads."""
    known = [row for row in trials if not np.isnan(row.get("best", np.nan))]
    if known:
        connected = [row for row in known if np.isfinite(row["best"])]
        found = [row for row in connected if row["outcome"] == FOUND]
        yield "pairs with known truth", str(len(known))
        yield "found of connected", f"{len(found)} of {len(connected)}"
        beyond = sum(row["outcome"] == FOUND for row in known) - len(found)
        yield "found though not connected", str(beyond)
        over = [100.0 * (row["cost"] / row["best"] - 1.0) for row in found]
        yield "cost over the best [%]", tell(over, 1)
    warm = [row for row in trials if row.get("warm_outcome") == FOUND]
    if warm:
        yield "warm: first way [s]", f"{tell(column(warm, 'warm_first'))} ({len(warm)})"
    sampled = [row for row in trials if "ompl_cpu" in row]
    if sampled:
        both = [row for row in sampled if row["ompl_length"] > 0 and row["outcome"] == FOUND]
        yield "OMPL: found", f"{sum(row['ompl_length'] > 0 for row in sampled)} of {len(sampled)}"
        yield "ours: found of the same", str(sum(row["outcome"] == FOUND for row in sampled))
        yield "OMPL: first way [s]", tell(column(both, "ompl_cpu"))
        ratios = [row["ompl_cpu"] / row["seconds_first"] for row in both]
        yield "OMPL over ours, first way", tell(ratios, 1)
        yield "OMPL slower", f"{sum(ratio > 1.0 for ratio in ratios)} of {len(both)}"
    threads = [same for same in column(trials, "same_on_threads") if same is not None]
    if threads:
        yield "same way on two threads", f"{sum(threads)} of {len(threads)}"


def show(rows: Rows) -> None:
    """Print the table."""
    names = list(dict.fromkeys(row["ground"] for row in rows))
    columns = {
        name: dict(summarise([row for row in rows if row["ground"] == name])) for name in names
    }
    table = Table(title="Median; 95th percentile. Times are CPU time")
    table.add_column("")
    for name in names:
        table.add_column(name, justify="right")
    for line in dict.fromkeys(line for values in columns.values() for line in values):
        table.add_row(escape(line), *(values.get(line, "") for values in columns.values()))
    console = Console()
    console.width = console.width if console.is_terminal else WIDTH
    console.print(table)


def main(
    count: Annotated[int, typer.Option(help="Pairs for each ground.")] = 20,
    budget: Annotated[float, typer.Option(help="Budget of a search in s.")] = 2.0,
    ground: Annotated[
        list[str] | None, typer.Option("--map", help="Beginning of a ground's name; repeatable.")
    ] = None,
    policy: Annotated[str, typer.Option(help="Torque policy.")] = EQUAL,
    rover: Annotated[str, typer.Option(help="Rover.")] = "lsr1",
    seed: Annotated[int, typer.Option(help="Seed of the pairs.")] = 0,
    truth: Annotated[int, typer.Option(help="Pairs for which the best is searched.")] = 0,
    truth_seconds: Annotated[
        float, typer.Option(help="Longest time for one of these in s.")
    ] = 300,
    warm: Annotated[int, typer.Option(help="Pairs asked again after a change of the map.")] = 0,
    ompl: Annotated[int, typer.Option(help="Pairs that OMPL is asked about, too.")] = 0,
    ompl_seconds: Annotated[float, typer.Option(help="Time after which OMPL gives up, s.")] = 20,
    ompl_planner: Annotated[str, typer.Option(help="BITstar, RRTConnect, RRTstar.")] = "BITstar",
    threads: Annotated[int, typer.Option(help="Pairs searched on one and on two threads.")] = 0,
    nodes: Annotated[int, typer.Option(help="Nodes with which the cheap test is checked.")] = 0,
    edges: Annotated[int, typer.Option(help="Edges that rank the difficulty.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Write all rows as JSON lines.")] = None,
) -> None:
    """Search ways between random poses and print what was found, in what time."""
    asked = dict(locals())
    console, rows = Console(stderr=True), []
    for name, terrain in grounds().items():
        if ground and not any(name.startswith(beginning) for beginning in ground):
            continue
        began = time.perf_counter()
        for row in run_case(Case(name, load_rover(rover), terrain, policy), asked):
            rows.append(row)
            if out is not None:
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
            console.print(f"{name} {len(rows)}, {time.perf_counter() - began:.0f} s", row)
    show(rows)


if __name__ == "__main__":
    typer.run(main)
