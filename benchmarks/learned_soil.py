# SPDX-License-Identifier: Apache-2.0
"""Drives over soil that yields, in the quasi-static simulator: what is learned, against the truth.

Run from the repository: python -m benchmarks.learned_soil [--grounds N] (extra `bench`)

Each soil that yields is the truth in turn, and each other one is what the learner is told.
"""

import itertools
from collections import defaultdict
from typing import Annotated

import numpy as np
import typer

from benchmarks.learning import add_noise
from benchmarks.measure import print_table
from rover_physics import Terrain, load_rover
from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.soil_file import BEKKER_WONG_MODEL, load_soils
from rover_physics.traction.balance import BalanceWriter
from rover_planner.learning.ground_learner import GroundLearner
from rover_planner.learning.soil_fit import PARAMETERS, SoilEstimate, SoilFit
from support.learning_drives import drive_over_soil

SECONDS = 95.0
"""Duration of a drive [s], 2.85 m at the nominal speed."""


def make_ground(seed: int) -> Terrain:
    """Return waves of 8 cm or so, whose slopes the softest soil just allows."""
    x, y = np.meshgrid(*2 * [np.arange(-2.6, 2.61, 0.04)])
    first, second = np.random.default_rng(seed).uniform(0.0, 6.3, 2)
    z = 0.048 * np.sin(2.1 * x + first) + 0.024 * np.sin(1.3 * x + 2.5 * y + second)
    return Terrain(z, 0.04, (-2.6, -2.6))


def quantities(estimate: SoilEstimate) -> dict[str, tuple[float, float]]:
    """Return means and deviations by name; the modulus has the unit of another exponent."""
    own = {name: estimate.parameters[name] for name in PARAMETERS if name != "modulus"}
    return {
        "sinkage": estimate.sinkage,
        "resistance": estimate.resistance,
        "strength": estimate.strength,
    } | own


def learn(rows: Floats, ground: Terrain, told: str, seed: int) -> SoilEstimate:
    """Return what the rows of a drive tell, with noise."""
    learner = GroundLearner(load_rover("lsr1"), ground, soil=told)
    for row in add_noise(rows, "usual", seed):
        learner.take(row)
    soil = learner.estimate.soil
    assert soil is not None
    return soil


def main(grounds: Annotated[int, typer.Option(help="Number of grounds.")] = 3) -> None:
    """Learn soils and print errors and coverage."""
    soft = [name for name, soil in load_soils().items() if soil.model == BEKKER_WONG_MODEL]
    rover, found = load_rover("lsr1"), defaultdict[str, list[tuple[float, float, bool]]](list)
    for truth, seed in itertools.product(soft, range(grounds)):
        ground = make_ground(seed)
        rows = drive_over_soil(rover, ground, truth, SECONDS)
        true = quantities(SoilFit(rover, BalanceWriter(rover).weight, truth).find_estimate())
        for told in set(soft) - {truth}:
            estimate = learn(rows, ground, told, seed)
            for name, (mean, std) in quantities(estimate).items():
                miss, value = abs(mean - true[name][0]), true[name][0]
                found[name].append((miss / value, miss / std, name in estimate.told_apart))
    table = []
    for name, own in found.items():
        errors, scores, apart = np.array(own, float).T
        table.append((name, np.median(errors), np.mean(scores < 1.96), apart.mean()))
    headings = "median error", "within 1.96 std", "told apart"
    columns = {"quantity": ""} | dict.fromkeys(headings, ".0%")
    print_table("Drives over soil, where another one was told", columns, table)


if __name__ == "__main__":
    typer.run(main)
