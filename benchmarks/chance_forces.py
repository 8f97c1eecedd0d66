# SPDX-License-Identifier: Apache-2.0
"""Draws the forces of one path of benchmarks.chance_drives: MuJoCo's, and those of the model.

Run from the repository: python -m benchmarks.chance_forces STREAM NUMBER PICTURE [--friction F]
It needs the extra `bench`.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.chance_drives import Truth, drive
from benchmarks.measure import console
from rover_physics.names import SERVO, WHEELS
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.traversability.judge import judge_path
from support.chance_paths import ChancePath, draw_path

WINDOW = 25
"""Number of periods of the steering (a second) over which MuJoCo's forces are averaged: contacts
of rigid wheels that slide hop."""


def trace(path: ChancePath, truth: Truth) -> np.ndarray:
    """Drive a path; return rows of time [s], way [m], speed [m/s], torques (6,) and loads (6,)."""
    rows, before = [], np.zeros(2)
    rover = path.rover(truth.max_torque)
    for moment in drive(rover, path.ground, path.poses, truth.friction):
        plant, here = moment.plant, moment.plant.pose[:2]
        went = float(np.hypot(*(here - before))) if rows else 0.0
        before = here
        loads = plant.measure_contacts().loads
        rows.append(np.r_[plant.time, moment.driven, went, moment.torques, loads])
    traced = np.array(rows)
    traced[:, 2] /= np.diff(traced[:, 0], prepend=0.0)
    return traced


def predict(path: ChancePath, truth: Truth) -> tuple[PathPrediction, str]:
    """Return the prediction of a path under speed servos, and why it is refused."""
    rover = path.rover(truth.max_torque)
    options = SweepOptions(policy=SERVO, friction=truth.friction)
    prediction, verdict = judge_path(rover, path.ground, path.poses, options)
    return prediction, verdict.reason


def draw(file: Path, prediction: PathPrediction, traced: np.ndarray) -> None:
    """Draw loads and torques of the wheels over the way; dots are MuJoCo's, lines the model's."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.subplots(2, 6, sharex=True, sharey="row")
    mean = np.ones(WINDOW) / WINDOW
    smooth = np.array([np.convolve(column, mean, mode="valid") for column in traced.T]).T
    for wheel, name in enumerate(WHEELS):
        for row, (first, values) in enumerate(
            ((9, prediction.wheel_loads), (3, prediction.torque))
        ):
            axes[row, wheel].plot(smooth[:, 1], smooth[:, first + wheel], ".", ms=2)
            axes[row, wheel].plot(prediction.distance, values[:, wheel], lw=1)
        axes[0, wheel].set_title(name.replace("_", " "), fontsize=8)
    axes[0, 0].set_ylabel("load [N]")
    axes[1, 0].set_ylabel("torque [N m]")
    figure.supxlabel("way [m]")
    figure.savefig(file, dpi=100)


def main(
    stream: Annotated[int, typer.Argument(help="Seed of the paths.")],
    number: Annotated[int, typer.Argument(help="Number of the path.")],
    picture: Annotated[Path, typer.Argument(help="Picture to draw.")],
    friction: Annotated[float, typer.Option(help="Factor of the friction that is told.")] = 1.0,
) -> None:
    """Drive a path as it is told, print what becomes of it, and draw forces."""
    path = draw_path(stream, number)
    truth = Truth(friction * path.friction, path.max_torque)
    traced = trace(path, truth)
    prediction, reason = predict(path, truth)
    out = console()
    out.print(replace(path, friction=truth.friction))
    out.print(f"MuJoCo drives {traced[-1, 1]:.2f} m of {path.length:.2f} m; the last second at "
              f"{traced[-WINDOW:, 2].mean():.3f} m/s")  # fmt: skip
    out.print(f"the model: {reason or 'passes'}")
    draw(picture, prediction, traced)


if __name__ == "__main__":
    typer.run(main)
