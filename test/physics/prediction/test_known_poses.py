# SPDX-License-Identifier: Apache-2.0
"""Tests of what is remembered of poses: it saves time and changes nothing else."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_physics import SweepOptions, judge_path, judge_pieces
from rover_physics.prediction.known_poses import KnownPoses
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.sweep import FIRST_BLOCK
from rover_physics.results.record import numbers_of
from support.grounds import rocky
from support.paths import poses_at
from support.predictions import assert_same
from support.rovers import LSR1

GROUND = rocky(5)
X = np.linspace(-1.0, 1.0, 101)
WAY, EASY = poses_at(X), poses_at(X, -0.2)
"""Paths, of which the second passes."""
STRAIGHT = np.tile([0.1, 0.0, 0.0], (len(WAY), 1))
"""Motions straight ahead."""


@pytest.fixture
def asked(monkeypatch):
    """Return the number of poses that models evaluate, as its `poses`."""
    counts, evaluate = SimpleNamespace(poses=0), PackedModel._evaluate

    def count(model, poses, *rest):
        counts.poses += len(poses)
        return evaluate(model, poses, *rest)

    monkeypatch.setattr(PackedModel, "_evaluate", count)
    return counts


@pytest.mark.parametrize("policy", ["equal", "optimal", "servo"])
def test_a_path_is_the_same_to_the_bit_with_what_is_known_and_is_not_evaluated_again(
    policy, asked
):
    options, known = SweepOptions(policy=policy), KnownPoses()
    anew = judge_path(LSR1, GROUND, WAY, options)
    first = judge_path(LSR1, GROUND, WAY, options, known=known)
    before = asked.poses
    again = judge_path(LSR1, GROUND, WAY, options, known=known)
    assert asked.poses - before < 0.1 * before  # wheels that climb, and other ways out
    for prediction, verdict in (first, again):
        assert repr(verdict) == repr(anew[1])  # NaN is not equal to NaN
        assert_same(prediction, anew[0])


def test_a_path_of_judged_pieces_is_hardly_evaluated_again(asked):
    of_pieces = KnownPoses()
    judge_pieces(LSR1, GROUND, [EASY[:51], EASY[50:]], known=of_pieces)
    before = asked.poses
    for known in (of_pieces, KnownPoses(others=of_pieces)):
        judge_path(LSR1, GROUND, EASY, known=known)
    assert asked.poses - before < 0.1 * before


def test_nothing_is_evaluated_or_searched_far_beyond_a_failure_at_the_start(asked):
    path = poses_at(np.linspace(-5.0, 1.0, 10 * FIRST_BLOCK))  # it begins off the map
    assert judge_path(LSR1, GROUND, path, stop_at_failure=True)[1].first_failure == 0
    assert asked.poses == FIRST_BLOCK


def test_a_changed_model_knows_nothing_and_the_same_one_all(asked):
    model = pack_model(LSR1, GROUND).remember(KnownPoses())
    model.evaluate(WAY, motions=STRAIGHT)
    before = asked.poses
    model.change(policy="equal").evaluate(WAY, motions=STRAIGHT)
    assert asked.poses == before
    for other in (model.change(friction=0.4), model.hold_steering(np.full(6, 0.1))):
        other.evaluate(WAY, motions=STRAIGHT)
        before += len(WAY)
        assert asked.poses == before


def test_places_are_forgotten_and_so_are_the_oldest_poses(asked):
    known = KnownPoses(most=150)
    model = pack_model(LSR1, GROUND).remember(known)

    def count_new(poses):
        before = asked.poses
        found = model.evaluate(poses, motions=STRAIGHT[: len(poses)])
        anew = pack_model(LSR1, GROUND).evaluate(poses, motions=STRAIGHT[: len(poses)])
        np.testing.assert_array_equal(numbers_of(found), numbers_of(anew))
        return asked.poses - before - len(poses)

    assert count_new(WAY) == 101 and count_new(WAY) == 0
    known.forget(lambda places: places[:, 0] > 0.5)
    assert count_new(WAY) == np.count_nonzero(WAY[:, 0] > 0.5)
    aside = np.add(WAY, (0.0, 0.1, 0.0))
    assert count_new(aside) == 101 and count_new(aside) == 0
    assert 52 <= count_new(WAY) <= 101  # 150 - 101 are left
