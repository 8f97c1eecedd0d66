# SPDX-License-Identifier: Apache-2.0
"""Names of version 0.1 work with a warning: they return the predictions of their successors."""

import numpy as np
import pytest

import rover_physics
from rover_physics import SweepOptions, judge_path, judge_poses
from support.grounds import smooth
from support.paths import poses_at
from support.rovers import LSR1

GROUND, POSES = smooth(1), poses_at(np.linspace(-0.2, 0.2, 9))
BACKWARD = SweepOptions(backward=True)


def call_old(name, *arguments, **named):
    warned = f"{name} goes with the next version; judge_"
    with pytest.warns(DeprecationWarning, match=warned) as at:
        found = getattr(rover_physics, name)(LSR1, GROUND, *arguments, **named)
    assert at[0].filename == __file__
    return found


def test_the_old_names_predict_as_the_new_ones_do_and_warn_where_they_are_called():
    back, bends = judge_path(LSR1, GROUND, POSES, BACKWARD)[0], np.full(len(POSES), 0.2)
    for found, expected in (
        (call_old("sweep_path", poses=POSES, options=BACKWARD), back),
        (call_old("sweep_paths", [POSES, POSES], BACKWARD)[1], back),
        (call_old("sweep_poses", POSES, bends), judge_poses(LSR1, GROUND, POSES, bends)[0]),
    ):
        np.testing.assert_array_equal(found.energy, expected.energy)
        np.testing.assert_array_equal(found.wheel_loads, expected.wheel_loads)
