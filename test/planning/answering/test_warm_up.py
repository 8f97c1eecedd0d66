# SPDX-License-Identifier: Apache-2.0
"""All kernels of answers, simulator and learner are among those that are compiled beforehand."""

import subprocess
import sys

PROGRAM = """
import gc
from dataclasses import replace

import numpy as np

from rover_physics.numerics.kernels import Kernel
from rover_physics.rover.rover_file import load_rover
from rover_planner.learning.ground_learner import GroundLearner
from rover_planner.nodes.warm_up import GROUPS
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.simulator.simulation import Simulation
from support.grounds import make_terrain, wall_at, waves
from support.learning_drives import climb
from support.services import make_service

def compiled():
    # A kernel that an earlier program left on disk is a new one on a fresh disk: both count.
    kernels = [one for one in gc.get_objects() if isinstance(one, Kernel)]
    return {f"{one.__module__}.{one.__name__}": len(one.signatures) for one in kernels}

coarse = {"waypoint_spacing": 0.1, "candidate_count": 2}
for group in GROUPS:
    for step in group:
        step()
make_service(**coarse)
before = compiled()
start, goal = (-1.0, 0.0, 0.0), (2.0, 0.2, 0.0)
heights = waves, lambda x, y: wall_at(0.9)(x, y) - np.where(x > 0.3, 0.06, 0.0)
grounds = [make_terrain(one, half=3.2) for one in heights]
grounds += [replace(one, elevation_std=np.full_like(one.elevation, 0.005)) for one in grounds]
fan = {"planner": "fan"}  # one search is enough
for parameters, asked in (
    ({"search_budget": 0.3}, grounds),
    (fan | {"policy": "optimal"}, grounds[::2]),
    (fan | {"soil": "mars_simulant"}, grounds[::2]),  # sinkage takes long
):
    answering = make_service(**coarse, **parameters)
    for ground in asked:
        answering.take_terrain(ground)
        answering.snapshot().answer(start, goal, 0.3).complete()
        answering.given_path = GivenPath(np.array([start, goal]), "")
        answering.given_path.judge(answering.snapshot())
given = RoverSimulatorParameters(start_x=-1.0)
simulation = Simulation(load_rover("lsr1"), grounds[0], given)
simulation.take_path(np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
for _ in range(3):
    simulation.advance(0.0, 0.02)
    simulation.plant.pull(np.full(6, 0.3), (0.03, 0.0), 0.02)
    simulation.plant.brake(0.02)
learner = GroundLearner(load_rover("lsr1"), grounds[0], soil="dry_sand")
for row in climb(load_rover("lsr1"), 0.1, 4.0):
    learner.take(row)
assert learner.estimate.soil and learner.layers.size
after = compiled()
print({name: count for name, count in after.items() if count > before.get(name, 0)})
"""


def test_no_question_and_no_step_of_simulator_or_learner_compiles_a_kernel():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "{}"
