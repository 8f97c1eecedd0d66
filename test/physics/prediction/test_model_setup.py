"""What a sweep needs is packed once, and anew where anything else is asked."""

import numpy as np
import pytest

from rover_physics.prediction.model_setup import set_up
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain

ROVER = load_rover("lsr1")
GROUND = Terrain(np.zeros((8, 8)), 0.05)


def test_the_same_request_is_packed_once():
    first, again = (
        set_up(ROVER, GROUND, SweepOptions(friction=0.5)),
        set_up(ROVER, GROUND, SweepOptions(friction=0.5)),
    )
    assert first.linkage is again.linkage and first.settings is again.settings


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
    usual = set_up(ROVER, GROUND).settings[field]
    assert set_up(ROVER, GROUND, SweepOptions(**change)).settings[field] != usual
    assert set_up(ROVER, GROUND).settings[field] == usual


def test_another_load_or_cell_size_is_packed_anew():
    usual = set_up(ROVER, GROUND)
    assert (
        set_up(ROVER, GROUND, SweepOptions(payload=3.0)).linkage["mass"] != usual.linkage["mass"]
    )
    fine = set_up(ROVER, Terrain(GROUND.elevation, 0.005)).samples
    assert fine["rows"] != usual.samples["rows"]


def test_a_load_on_the_tool_is_not_kept():
    loaded = set_up(ROVER, GROUND, SweepOptions(tool_force=np.array([0.0, 0.0, 5.0])))
    assert loaded.linkage["has_tool_load"]
    assert not set_up(ROVER, GROUND).linkage["has_tool_load"]
