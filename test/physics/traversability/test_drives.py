# SPDX-License-Identifier: Apache-2.0
"""Verdicts agree with drives in MuJoCo, over obstacles and along curves.

All numbers of drives are those of `python -m benchmarks.validate`.
"""

from functools import lru_cache

import numpy as np
import pytest

from benchmarks.validate import PASSED, judge_drives, read_curves
from rover_physics import judge_path, load_rover
from rover_physics.traversability.verdict import hold_against_limits


@lru_cache(maxsize=3)
def passes(policy: str) -> np.ndarray:
    """Return for every drive (n, 2) whether it is passable and whether it passed."""
    judged = judge_drives(policy)
    return np.array([(verdict.traversable, drive.outcome == PASSED) for drive, verdict in judged])


@pytest.mark.parametrize(
    ("policy", "least"), [("equal", 8), pytest.param("servo", 25, marks=pytest.mark.long)]
)
def test_nothing_passable_without_traction_control_got_stuck_or_tipped(policy, least):
    passable, passed = passes(policy).T
    assert len(passed) == 60 and passable.sum() >= least
    assert passed[passable].all()


@pytest.mark.long
def test_nine_of_ten_drives_end_as_judged_and_whatever_passed_is_passable_with_traction_control():
    for policy, least in (("servo", 57), ("optimal", 54)):
        assert (passes(policy)[:, 0] == passes(policy)[:, 1]).sum() >= least
    passable, passed = passes("optimal").T
    assert passable[passed].all()
    equal, servo, optimal = (passes(policy)[:, 0] for policy in ("equal", "servo", "optimal"))
    assert (equal <= servo).all() and (servo <= optimal).all()


def test_nine_of_ten_curves_are_kept_as_judged_and_none_is_passed_that_the_rover_left():
    found = []
    for curve in read_curves():
        asked = curve.rover, curve.ground, curve.path, curve.options("servo")
        prediction = judge_path(*asked)[0]
        verdict = hold_against_limits(curve.rover, prediction)
        found.append((verdict.traversable, curve.kept))
        if curve.mode == "skid":
            assert verdict.code == "friction" and "turns off its path" in verdict.reason
    passable, kept = np.array(found).T
    assert len(kept) == 25 and (passable == kept).mean() >= 0.9
    assert kept[passable].all()


@pytest.mark.parametrize("modes", [("steered", "spot"), ("skid", "skid_spot")])
def test_wheel_forces_and_torques_along_curves_are_those_of_mujoco(modes):
    errors, ratios = [], []
    for curve in read_curves():
        if curve.mode in modes and len(curve.poses):
            found = curve.predict_trace()
            drives = found.speed_share > 0.0
            forces = np.linalg.norm([found.wheel_loads, found.tangential, found.lateral], axis=0)
            errors.append(np.abs(forces - curve.forces)[drives].ravel())
            ratios.append(
                np.abs(found.torque[drives]).mean() / np.abs(curve.torques[drives]).mean()
            )
    errors = np.concatenate(errors) / load_rover("lsr1").weight
    assert errors.size >= 1500 and np.median(errors) <= 0.03
    if "skid" in modes:
        assert np.median(np.abs(np.array(ratios) - 1.0)) <= 0.25
