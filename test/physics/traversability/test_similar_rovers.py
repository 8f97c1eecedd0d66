# SPDX-License-Identifier: Apache-2.0
"""A rover of another size, mass or gravity gets the verdict of its like on similar ground."""

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_paths
from rover_physics.rover.model import Rover
from support.paths import arc_of, poses_at
from support.rough_grounds import bouldered, enlarged, rocky, smooth, with_std
from support.rovers import LSR1, SIMILAR, similar

RATIOS = (
    "status", "contact_angle", "friction_utilisation", "torque_saturation", "slip_ratio",
    "tip_over_ratio", "tip_over_force_angle", "speed_share", "falling", "roll", "pitch",
)  # fmt: skip
LENGTHS = ("belly_clearance", "wheel_drop", "lift_height", "wheel_centres", "distance")


PATHS = [
    arc_of(bend, 0.02 * np.arange(50), yaw) + poses_at(-0.9, y)
    for y in (-0.8, 0.2)
    for yaw, bend in ((0.0, 0.0), (0.4, 0.7))
]


def judge(rover: Rover, ground: Terrain, policy: str):
    """Yield what is told of each of PATHS on ground as large as the rover, without units."""
    size = rover.wheel.radius / LSR1.wheel.radius
    paths = [path * [size, size, 1.0] for path in PATHS]
    options = SweepOptions(policy=policy)
    judged = judge_paths(rover, enlarged(ground, size), paths, options, accepted_chance=0.05)
    for prediction, verdict in judged:
        yield "verdict", (verdict.codes, verdict.first_failure, verdict.failure_chance)
        for name in RATIOS:
            yield name, getattr(prediction, name)
        for name in LENGTHS:
            yield name, getattr(prediction, name) / size
        yield "wheel_loads", prediction.wheel_loads / rover.weight


@pytest.mark.parametrize("like", SIMILAR)
@pytest.mark.parametrize(
    ("ground", "policy"),
    [
        (with_std(smooth(3), 0.004), "equal"),
        (bouldered(2), "servo"),
        (rocky(1), "servo"),
        (rocky(1), "optimal"),
    ],
    ids=["uncertain", "boulders", "rocks", "control"],
)
def test_similar_rovers_get_the_same_verdict_to_the_bit(ground, policy, like):
    there = judge(similar(LSR1, *SIMILAR[like]), ground, policy)
    for (name, expected), (_, found) in zip(judge(LSR1, ground, policy), there, strict=True):
        np.testing.assert_equal(found, expected, err_msg=name)
