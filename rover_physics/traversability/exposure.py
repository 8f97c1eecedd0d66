# SPDX-License-Identifier: Apache-2.0
"""The exposure of a path: how long it comes how near to the limits that count as risk."""

import numpy as np

from rover_physics.numerics.kernels import exact_kernel
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import find_risk, find_uses, limits_of
from rover_physics.rover.model import Rover

SAFE = 0.5
"""Use of a limit up to which there is no exposure."""


def find_exposure(rover: Rover, prediction: PathPrediction) -> float:
    """Return the exposure [s]: the integral over time of the squared excess over SAFE.

    The excess is (use - SAFE) / (1 - SAFE), 0 below SAFE and 1 at the limit and beyond.
    """
    uses = find_uses(limits_of(rover, prediction.policy), prediction.results)
    counts = uses.limits.records["is_risk"] > 0
    risk = np.fmax.reduce(uses.use[:, counts], axis=1, initial=0.0)
    excess = np.clip((risk - SAFE) / (1.0 - SAFE), 0.0, 1.0) ** 2
    return float(np.sum(0.5 * (excess[1:] + excess[:-1]) * np.diff(prediction.time)))


@exact_kernel
def add_exposure(numbers, time, limits):
    """Return the exposure [s] as `find_exposure`, of results (n, NUMBERS) at times (n,) [s]."""
    exposure, before = 0.0, 0.0
    for row in range(numbers.shape[0]):
        excess = (find_risk(numbers, row, limits) - SAFE) / (1.0 - SAFE)
        here = min(max(excess, 0.0), 1.0) ** 2
        if row > 0:
            exposure += 0.5 * (before + here) * (time[row] - time[row - 1])
        before = here
    return exposure
