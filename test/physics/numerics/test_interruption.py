# SPDX-License-Identifier: Apache-2.0
"""Sweeps stop where their caller says so, and slices change no result."""

import itertools

import numpy as np
import pytest

from rover_physics.bounds.path import bound_path
from rover_physics.numerics import interruption
from rover_physics.numerics.interruption import check_interruption, interruptible, slices
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from support.grounds import make_terrain, waves
from support.uncertain_grounds import with_std


class StoppedError(Exception):
    """Raised by the checks of these tests."""


def stop_at(call: int):
    """Return a check that raises at its n-th call."""
    calls = iter(range(1, call + 1))

    def check() -> None:
        if next(calls) == call:
            raise StoppedError

    return check


def along_x(count: int) -> np.ndarray:
    poses = np.zeros((count, 3))
    poses[:, 0] = np.linspace(-1.5, 1.5, count)
    return poses


def test_slices_cover_all_items_once_and_in_order_and_without_a_check_there_is_one():
    check_interruption()
    assert list(slices(10**6)) == [slice(0, 10**6)]
    with interruptible(lambda: None):
        parts = list(slices(3000))
    assert parts[0].start == 0 and parts[-1].stop == 3000 and len(parts) > 1
    assert all(one.stop == other.start for one, other in itertools.pairwise(parts))


def test_a_check_that_raises_ends_the_sweep_and_the_next_one_runs():
    rover, ground, poses = load_rover("lsr1"), make_terrain(waves), along_x(2000)
    with pytest.raises(StoppedError), interruptible(stop_at(2)):
        judge_path(rover, ground, poses)[0]
    assert judge_path(rover, ground, poses)[0].settled.all()


def test_slices_change_no_bit_of_a_prediction_or_its_bounds(monkeypatch):
    rover, poses = load_rover("lsr1"), along_x(300)
    ground = with_std(make_terrain(waves), 0.002)
    whole = judge_path(rover, ground, poses)[0]
    whole_bounds = bound_path(rover, ground, whole)
    monkeypatch.setattr(interruption, "FIRST_SLICE", 7)
    monkeypatch.setattr(interruption, "MAX_GROWTH", 1.0)
    with interruptible(lambda: None):
        parts = judge_path(rover, ground, poses)[0]
        parts_bounds = bound_path(rover, ground, parts)
    for name in ("position", "wheel_loads", "friction_utilisation", "tip_over_ratio"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    for name in ("roll", "wheel_loads", "belly_clearance"):
        np.testing.assert_array_equal(getattr(parts_bounds, name), getattr(whole_bounds, name))
