# SPDX-License-Identifier: Apache-2.0
"""What a sweep needs is packed once, and anew where anything else is asked."""

import numpy as np
import pytest

from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain

ROVER = load_rover("lsr1")
GROUND = Terrain(np.zeros((8, 8)), 0.05)


def test_the_same_request_is_packed_once():
    first, again = (
        pack_model(ROVER, GROUND, SweepOptions(friction=0.5)),
        pack_model(ROVER, GROUND, SweepOptions(friction=0.5)),
    )
    assert first is again


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"friction": 0.5}, "friction"),
        ({"max_torque": 1.0}, "max_torque"),
        ({"policy": "optimal"}, "policy"),
        ({"soil": "dry_sand"}, "on_soil"),
        ({"backward": True}, "direction"),
    ],
)
def test_another_request_is_packed_anew(change, field):
    usual = pack_model(ROVER, GROUND).settings[field]
    assert pack_model(ROVER, GROUND, SweepOptions(**change)).settings[field] != usual
    assert pack_model(ROVER, GROUND).settings[field] == usual


def test_a_load_on_the_tool_is_not_kept():
    loaded = pack_model(ROVER, GROUND, SweepOptions(tool_force=np.array([0.0, 0.0, 5.0])))
    assert loaded.record.linkage["has_tool_load"]
    assert not pack_model(ROVER, GROUND).record.linkage["has_tool_load"]
