# SPDX-License-Identifier: Apache-2.0
"""Verdicts agree with drives in MuJoCo over steps, ditches, bumps and slopes."""

from collections import Counter
from functools import lru_cache

import pytest

from support.reference_drives import PASSED, judge_drives, read_drives


@lru_cache(maxsize=2)
def verdicts(policy: str) -> list:
    return [(drive, verdict) for drive, _, verdict in judge_drives(policy)]


def test_there_are_60_drives_of_five_kinds():
    drives = read_drives()
    assert len(drives) == 60
    assert set(Counter(drive.kind for drive in drives)) == {
        "step",
        "ditch",
        "bump_one_side",
        "slope",
        "cross_slope",
    }
    assert {drive.outcome for drive in drives} == {PASSED, "stuck", "tipped"}


@pytest.mark.long
def test_under_optimal_torques_at_least_54_drives_end_as_judged():
    judged = verdicts("optimal")
    assert sum(verdict.traversable == (drive.outcome == PASSED) for drive, verdict in judged) >= 54


@pytest.mark.slow
def test_nothing_passable_under_equal_torques_got_stuck_or_tipped():
    passable = [drive for drive, verdict in verdicts("equal") if verdict.traversable]
    assert len(passable) >= 8
    assert [drive.label for drive in passable if drive.outcome != PASSED] == []


@pytest.mark.long
def test_whatever_passed_is_passable_with_traction_control():
    refused = [
        f"{drive.label}: {verdict.reason}"
        for drive, verdict in verdicts("optimal")
        if drive.outcome == PASSED and not verdict.traversable
    ]
    assert refused == []


@pytest.mark.long
def test_what_equal_torques_pass_the_best_torques_pass_too():
    pairs = zip(verdicts("equal"), verdicts("optimal"), strict=True)
    assert all(best.traversable for (_, equal), (_, best) in pairs if equal.traversable)


@pytest.mark.long
def test_what_is_refused_is_refused_for_its_forces():
    for drive, verdict in verdicts("optimal"):
        if not verdict.traversable:
            assert verdict.code in {"friction", "torque", "wheel_lift", "tip_over"}, drive.label


@pytest.mark.long
@pytest.mark.parametrize("kind", ["slope", "cross_slope", "step"])
def test_on_slopes_and_steps_every_drive_ends_as_judged(kind):
    for drive, verdict in verdicts("optimal"):
        if drive.kind == kind:
            assert verdict.traversable == (drive.outcome == PASSED), drive.label
