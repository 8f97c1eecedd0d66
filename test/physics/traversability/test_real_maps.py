# SPDX-License-Identifier: Apache-2.0
"""Real ground before Spirit: the plain is passable, a ridge is refused for the belly."""

import numpy as np
import pytest

from rover_physics import judge_path, load_rover, load_terrain


@pytest.mark.parametrize(
    ("start", "end", "code"),
    [
        ((-44.684, -19.499), (-47.58, -20.30), ""),
        ((-42.307, -22.639), (-44.128, -21.814), "belly"),
    ],
)
def test_known_ground_is_passable_and_a_ridge_is_refused_by_its_name(start, end, code):
    (dx, dy), count = np.subtract(end, start), int(np.hypot(*np.subtract(end, start)) / 0.02) + 2
    poses = np.column_stack([np.linspace(start, end, count), np.full(count, np.arctan2(dy, dx))])
    verdict = judge_path(load_rover("lsr1"), load_terrain("spirit"), poses)[1]
    assert verdict.code == code
    assert verdict.traversable if code == "" else verdict.first_failure > 20
