# SPDX-License-Identifier: Apache-2.0
"""How well a slip is known: as well as that of the wheel that is known worst, and not at once."""

import numpy as np
from scipy.spatial.transform import Rotation

from rover_physics.numerics.records import new_record
from rover_planner.learning.contact_sense import WHEEL_STATE
from rover_planner.learning.wheel_slip import BLOCK, SlipWindows

RADIUS, RATE, NOISE = 0.1, 0.1, 0.002
PLACES = np.array([(x, y, 0.0) for y in (-0.3, 0.3) for x in (-0.4, 0.0, 0.4)])
"""Wheels about the middle of a turn on the spot [m]."""


def test_errors_of_the_heading_are_noise_of_the_slips_of_outer_wheels_and_at_first_count_more():
    rng, windows, found = np.random.default_rng(0), SlipWindows(RADIUS, 0.08), []
    for time in BLOCK * np.arange(600):  # without slip
        turn = Rotation.from_euler("z", RATE * time + NOISE * rng.standard_normal())
        outwards = turn.apply(PLACES / np.linalg.norm(PLACES, axis=1, keepdims=True))
        along = np.cross([0.0, 0.0, 1.0], outwards)
        state = new_record(WHEEL_STATE, centres=turn.apply(PLACES), along=along, axles=-outwards)
        rolled = RATE * time * np.hypot(*PLACES[:, :2].T) / RADIUS
        found.append(windows.take(float(time), rolled, state))
    found = [window for window in found if window is not None]
    slips = np.array([window.slip for window in found[100:]])
    known = np.mean([window.deviation for window in found[100:]])
    assert slips.std(axis=0).max() < 1.1 * known
    assert min(window.deviation for window in found[:5]) > 1.5 * known
