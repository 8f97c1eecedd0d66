# SPDX-License-Identifier: Apache-2.0
"""Wheels that wedge in slots as wide as themselves."""

import pytest

from rover_physics import SweepOptions, judge_paths
from rover_physics.names import OPTIMAL, SERVO
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rovers import LSR1

ROVER, PATH = unlimited(LSR1), drive_path()


@pytest.mark.parametrize("policy", [OPTIMAL, SERVO])
def test_a_wheel_that_falls_into_a_slot_as_wide_as_itself_is_wedged(policy):
    options = SweepOptions(policy, friction=0.86, max_torque=2.44)
    wide, narrow = (
        judge_paths(ROVER, drive_ground("ditch", width), [PATH], options, check_entrapment=False)
        for width in (0.194, 0.10)
    )
    assert wide[0][1].code == "friction" and "wedged" in wide[0][1].reason
    assert narrow[0][1].traversable


def test_a_wedged_rover_is_refused_with_any_friction_in_all_samples():
    options = SweepOptions(OPTIMAL, friction=0.86, max_torque=2.44)
    asked = ROVER, drive_ground("ditch", 0.194), [PATH], options
    assert judge_paths(*asked, accepted_chance=1.0)[0][1].failure_chance == 1.0
