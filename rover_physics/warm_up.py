# SPDX-License-Identifier: Apache-2.0
"""The kernels of predictions, verdicts and bounds: compiled, or loaded from disk.

`python -m rover_physics.warm_up` compiles all of them.
"""

import os
from dataclasses import replace

import numpy as np

from rover_physics.bounds.path import find_bounds
from rover_physics.compilation import compile_groups
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.record import new_results
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import pack_ground
from rover_physics.traversability.judge import judge_path


def evaluate_poses() -> None:
    """Evaluate the model at a pose."""
    model = pack_model(*_rover_and_step())
    model.evaluate(np.zeros((1, 3)))


def judge_paths() -> None:
    """Judge short paths up and down a step, on hard ground and on soil."""
    rover, step = _rover_and_step()
    poses = np.zeros((8, 3))
    poses[:, 0] = np.linspace(-0.12, 0.02, 8)
    judge_path(rover, step, poses)
    judge_path(rover, step, poses, SweepOptions(soil="mars_simulant"))
    down = SweepOptions(backward=True)
    judge_path(rover, step, poses[::-1], down, stop_at_failure=True)


def bound_poses() -> None:
    """Bound a pose on a map with uncertain heights; it need not settle."""
    rover, step = _rover_and_step()
    grounds, results = (pack_ground(step),) * 3, new_results(1)
    results["status"], results["motion"] = PoseStatus.NOT_SETTLED, 0.0
    find_bounds(pack_model(rover, step), grounds, np.zeros((1, 3)), results)


def _rover_and_step() -> tuple[Rover, Terrain]:
    """Return a rover and a map with a step and all layers that questions look at."""
    layer = np.ones((64, 64))
    step = Terrain(np.where(np.arange(64) > 40, 0.1, 0.0) * layer, 0.05, (-1.6, -1.6))
    return load_rover("lsr1"), replace(step, friction=layer)


EXACT = (evaluate_poses, judge_paths)
"""All that needs a map whose heights are exact: questions, scores, torque ranges."""
UNCERTAIN = (bound_poses,)
"""All that a question needs besides on other maps."""


def warm_up() -> None:
    """Load the kernels of questions, or compile them in this process."""
    for step in (*EXACT, *UNCERTAIN):
        step()


if __name__ == "__main__":
    from rover_physics import warm_up as here  # the name by which processes find the steps

    compile_groups([here.EXACT, here.UNCERTAIN], print, os.cpu_count() or 1)
