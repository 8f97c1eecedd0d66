"""A short run of the fuzzer, which `make fuzz` runs for longer: nothing dies, hangs or is lost."""

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="the fuzzer throws ROS messages")

from benchmarks.fuzz.hostile import HostileMaker
from benchmarks.fuzz.inside import PlannerTarget, fuzz_inside
from benchmarks.fuzz.over_dds import fuzz_over_dds
from benchmarks.fuzz.tally import Tally

SEED = 7


def test_hostile_messages_in_this_process_do_no_harm(capsys):
    tally = fuzz_inside(SEED, 400)
    assert tally.defects == []
    assert tally.total >= 400 and len(tally.counts) == 10
    tally.show("in this process")
    assert "defects: 0" in capsys.readouterr().out


@pytest.mark.slow
def test_hostile_inputs_over_dds_do_no_harm():
    tally = fuzz_over_dds(SEED, 150)
    assert tally.defects == []
    assert tally.total >= 150


def test_the_same_seed_throws_the_same_inputs():
    ours, others = (HostileMaker(SEED) for _ in range(2))
    for kind in ours.kinds * 5:
        assert repr(ours.make(kind)) == repr(others.make(kind))
    assert ours.damaged(bytes(100)) == others.damaged(bytes(100))


def test_a_lost_map_is_found():
    target = PlannerTarget()
    assert target.probe() == ""
    broken = np.where(np.eye(121) > 0.0, 0.5, 0.0)
    target.service.take_terrain(type(target.service.terrain)(broken, 0.05, (-3.0, -3.0)))
    assert target.probe() == "another answer to the same question"


def test_a_defect_is_shown(capsys):
    tally = Tally()
    tally.take("cloud", "taken", 0.1)
    tally.defects.append("cloud: boom")
    tally.show("title")
    shown = capsys.readouterr().out
    assert "defects: 1" in shown and "1 x cloud: boom" in shown
