"""Energy, slip distance and torque of policy "servo" against speed servos in MuJoCo.

Run from the repository: python -m benchmarks.servos [--quick] [--out FOLDER]
It needs the extra `bench`. Its results are in docs/validation.md.
"""

import argparse
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.traction import (
    DROOP_CONTROLLER,
    END,
    OBSTACLES,
    QUICK_STEP,
    SPEED,
    START,
    Obstacle,
    drive,
    make_ground,
)
from rover_physics.prediction.servo_path import add_up_rate
from rover_physics.prediction.sweep import sweep_in_full
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from support.reference_drives import unlimited

SPACING = 0.01
"""Distance of waypoints [m]."""
TIMESTEP = 0.002
"""Time step of MuJoCo [s]. With the usual 4 ms its wheels chatter on their contacts, and slip."""


def predict(obstacle: Obstacle) -> dict[str, float]:
    """Return energy [J], slip distance [m] and mean torque [N m] of the model."""
    rover = replace(unlimited(load_rover("lsr1")), nominal_speed=SPEED)
    x = np.linspace(START, END, round((END - START) / SPACING) + 1)
    path = np.column_stack([x, 0.0 * x, 0.0 * x])
    options = SweepOptions(policy="servo", friction=obstacle.friction)
    swept = sweep_in_full(rover, make_ground(obstacle), [path], options)[0]
    time = swept.prediction.time
    slid = add_up_rate("slip_speed", time, swept.results, swept.crossings)[-1]
    torque = add_up_rate("torque_saturation", time, swept.results, swept.crossings)[-1]
    return {
        "energy": float(swept.prediction.energy[-1]),
        "slip": float(slid.mean()),
        "torque": float(torque.mean() / time[-1] * rover.wheel.max_torque),
    }


def compare(obstacle: Obstacle) -> dict:
    """Return what plant and model find on an obstacle."""
    plant = drive(obstacle, DROOP_CONTROLLER, timestep=TIMESTEP)
    return asdict(obstacle) | {"plant": asdict(plant), "model": predict(obstacle)}


def show(rows: list[dict]) -> Table:
    """Return a table of all obstacles that the plant passed, with medians of the ratios."""
    names = ("energy", "slip", "torque")
    table = Table(title="Speed servos over 2.4 m at 6 cm/s: MuJoCo, model, and their ratio")
    table.add_column("obstacle")
    for name, unit in zip(names, ("J", "m", "N m"), strict=True):
        table.add_column(f"{name} [{unit}]", justify="right")
    ratios = []
    for row in rows:
        pairs = [(row["plant"][name], row["model"][name]) for name in names]
        ratios.append([ours / theirs for theirs, ours in pairs])
        label = Obstacle(row["kind"], row["size"], row["friction"]).label
        table.add_row(label, *(f"{a:.2f} {b:.2f} {b / a:.2f}" for a, b in pairs))
    table.add_row("median", *(f"{value:.2f}" for value in np.median(ratios, axis=0)))
    errors = np.median(np.abs(np.array(ratios) - 1.0), axis=0)
    table.add_row("median error", *(f"{100.0 * value:.0f} %" for value in errors))
    return table


def main() -> None:
    """Run the drives, print a table and write JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"only every {QUICK_STEP}th obstacle")
    parser.add_argument("--out", type=Path, default=Path("bench_output"))
    arguments = parser.parse_args()
    obstacles = OBSTACLES[::QUICK_STEP] if arguments.quick else OBSTACLES
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(mp_context=context) as pool:
        rows = [row for row in pool.map(compare, obstacles) if row["plant"]["passed"]]
    Console().print(show(rows))
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "servos.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
