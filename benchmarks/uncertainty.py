"""Counts how often values on random maps leave their bounds.

The tables are in docs/notes/uncertainty.md.

Run from the repository: python -m benchmarks.uncertainty [maps per case]
"""

import sys
import time
from functools import partial

import numba
import numpy as np
from rich.console import Console
from rich.table import Table

from rover_physics.bounds.path import BOUNDED_VALUES, bound_path
from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from support.uncertain_grounds import (
    Outcome,
    draw_path,
    path_across,
    step,
    uncertain_grounds,
    with_std,
)

MAPS = 40
"""Default number of random maps per case."""
STDS = (0.001, 0.005)
"""Standard deviations of the heights [m]."""
FACES = (0.3, 0.8, 1.0, 1.15, 1.3, 1.6)
"""Heights of steep faces in wheel radii, below and above one radius."""
REPEATS = 5
"""Time measurements, of which the least counts."""


def correlation_lengths(rover: Rover) -> dict[str, float]:
    """Return the correlation lengths of the height errors [m], by name."""
    wheels = rover.suspension.wheels
    return {
        "each cell": 0.0,
        "a wheel": rover.wheel.radius,
        "a wheelbase": wheels["front"][0] - wheels["rear"][0],
    }


def draw_all(console: Console, maps: int) -> dict[tuple[str, ...], Outcome]:
    """Return the outcome of every case, by rover, ground, std, correlation and policy."""
    outcomes = {}
    for name in ("lsr1", "m2020"):
        rover = load_rover(name)
        for ground, terrain in uncertain_grounds(rover).items():
            for policy in ("equal", "optimal"):
                console.print(f"{name}, {ground}, {policy}")
                for std in STDS:
                    for kind, length in correlation_lengths(rover).items():
                        key = (name, ground, f"{1e3 * std:g} mm", kind, policy)
                        seed = len(outcomes)
                        outcomes[key] = draw_path(
                            rover, with_std(terrain, std), path_across(seed), length, maps, seed,
                            policy,
                        )  # fmt: skip
    return outcomes


def show_by_case(outcomes: dict[tuple[str, ...], Outcome]) -> Table:
    """Return a table of waypoints outside their bounds, summed over each property of the cases."""
    table = Table(title="Waypoints with anything outside of its bounds, three sigma")
    for heading in ("cases", "waypoints", "outside", "per 1000", "without bounds"):
        table.add_column(heading, justify="left" if heading == "cases" else "right")
    groups = {"all": list(outcomes.values())}
    for place in range(5):
        for key, outcome in outcomes.items():
            groups.setdefault(key[place], []).append(outcome)
    for name, members in groups.items():
        waypoints = sum(outcome.waypoints for outcome in members)
        outside = sum(outcome.outside["any"] for outcome in members)
        unbounded = sum(outcome.unbounded for outcome in members)
        share = f"{1e3 * outside / waypoints:.2f}"
        table.add_row(name, f"{waypoints}", f"{outside}", share, f"{unbounded}")
    return table


def show_by_value(outcomes: dict[tuple[str, ...], Outcome]) -> Table:
    """Return a table of how often each value left its bounds, and the width of the bounds."""
    table = Table(title="Each value; width is that of the bounds over the range drawn")
    for heading in ("value", "outside", "width: median", "cell", "wheel", "wheelbase"):
        table.add_column(heading, justify="left" if heading == "value" else "right")
    for name in (*BOUNDED_VALUES, "no pose"):
        outside = sum(outcome.outside[name] for outcome in outcomes.values())
        row = [name, f"{outside}"]
        for kind in (None, "each cell", "a wheel", "a wheelbase"):
            widths = [
                outcome.widths.get(name, np.nan)
                for key, outcome in outcomes.items()
                if kind in (None, key[3]) and key[4] == "equal"
            ]
            known = np.array(widths)[np.isfinite(widths)]
            row.append(f"{np.median(known):.1f}" if known.size else "-")
        table.add_row(*row)
    return table


def show_faces(maps: int) -> Table:
    """Return a table of waypoints outside their bounds, and without bounds, on steep faces."""
    table = Table(title="Straight over a face, waypoints every 3 cm, by its height in wheel radii")
    headings = ("rover", "height", "std", "waypoints", "outside", "per 1000", "without bounds")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "rover" else "right")
    x = np.arange(-1.2, 2.0, 0.03)
    poses = np.column_stack([x, np.full_like(x, 0.05), np.full_like(x, 0.03)])
    for name in ("lsr1", "m2020"):
        rover = load_rover(name)
        for height in FACES:
            terrain = step(height * rover.wheel.radius)
            for std in STDS:
                outcomes = [
                    draw_path(rover, with_std(terrain, std), poses, length, maps, seed)
                    for seed, length in enumerate(correlation_lengths(rover).values())
                ]
                waypoints = sum(outcome.waypoints for outcome in outcomes)
                outside = sum(outcome.outside["any"] for outcome in outcomes)
                numbers = f"{waypoints}", f"{outside}", f"{1e3 * outside / waypoints:.2f}"
                unbounded = f"{outcomes[0].unbounded} of {len(x)}"
                table.add_row(name, f"{height}", f"{1e3 * std:g} mm", *numbers, unbounded)
    return table


def show_times() -> Table:
    """Return a table of the time of the bounds per waypoint on one core."""
    numba.set_num_threads(1)
    table = Table(title="Time per waypoint on one core in us, least of five")
    for heading in ("rover", "ground", "policy", "sweep", "bounds"):
        table.add_column(heading, justify="left" if heading < "s" else "right")
    for name in ("lsr1", "m2020"):
        rover = load_rover(name)
        for ground in ("level", "rocks"):
            terrain = with_std(uncertain_grounds(rover)[ground], 0.005)
            poses = path_across(1, 200)
            for policy in ("equal", "optimal"):
                options = SweepOptions(policy=policy)
                prediction = sweep_path(rover, terrain, poses, options)
                sweep = _least(partial(sweep_path, rover, terrain, poses, options))
                bounds = _least(partial(bound_path, rover, terrain, prediction, options))
                per_waypoint = (f"{1e6 * seconds / 200:.0f}" for seconds in (sweep, bounds))
                table.add_row(name, ground, policy, *per_waypoint)
    return table


def _least(function) -> float:
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Draw the maps, measure and print the tables."""
    maps = int(sys.argv[1]) if len(sys.argv) > 1 else MAPS
    outcomes = draw_all(Console(stderr=True), maps)
    console = Console()
    faces = show_faces(max(1, maps // 4))
    for table in (show_by_case(outcomes), show_by_value(outcomes), faces, show_times()):
        console.print(table)


if __name__ == "__main__":
    main()
