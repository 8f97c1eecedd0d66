# SPDX-License-Identifier: Apache-2.0
"""The reach of a rover holds at all angles of its suspension."""

import numpy as np
import pytest

from rover_physics.numerics.records import new_record
from rover_physics.rover.extent import find_reach
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from support.rover_geometry import turned_round
from support.rovers import LSR1, M2020


@pytest.mark.parametrize("rover", [LSR1, M2020, turned_round(LSR1)], ids=lambda rover: rover.name)
def test_no_wheel_is_farther_than_the_reach_whatever_the_angles(rover):
    linkage, placement = pack_linkage(rover), new_record(PLACEMENT)
    for angles in np.random.default_rng(2).uniform(-np.pi, np.pi, (3000, 3)):
        place(linkage, np.zeros(3), np.array([0.0, 0.0, 0.0, *angles]), placement)
        x, y, z = placement.centres.T
        rim = np.hypot(rover.wheel.radius, 0.5 * rover.wheel.width)
        assert (np.sqrt(x**2 + y**2 + z**2) + rim).max() <= find_reach(rover) + 1e-12
