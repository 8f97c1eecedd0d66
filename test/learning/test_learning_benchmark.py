# SPDX-License-Identifier: Apache-2.0
"""The benchmark of learning counts the time until a stuck rover is noticed from its halt on."""

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="install the extra bench")
from benchmarks import learning
from rover_planner.learning.drive_log import TIME, X
from support.learning_drives import climb

DRIVE = learning.LearningDrive(
    "slope", 0.0, 1, learning.CONSTANT, (0.8, 0.8), learning.SERVO, 0.004, "none", 1
)
"""A drive on flat ground."""


def test_a_rover_that_creeps_before_it_halts_is_noticed_no_earlier_than_it_halts(monkeypatch):
    rows = climb(learning.told_rover(), 0.0, 15.0)
    rows[:, X] = np.interp(rows[:, TIME], [0.0, 5.0, 15.0], [-1.0, -0.7, -0.67])
    monkeypatch.setattr(learning, "record", lambda *_: learning.Recorded(rows, passed=False))
    learned = learning.learn(DRIVE)
    assert learned.estimate.immobilised_time < learned.stuck_time - 0.5
    assert learned.stuck_time <= learned.noticed_time < learned.stuck_time + 0.2
