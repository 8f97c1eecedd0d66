# SPDX-License-Identifier: Apache-2.0
"""Nothing passes on NaN: a path is traversable only if all that decides it is a number."""

import math
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics import (
    PoseStatus,
    RoverError,
    SweepOptions,
    Terrain,
    classify_path,
    find_torque_ranges,
    judge_path,
    score_poses,
)
from rover_physics.errors import ModelError
from rover_physics.names import EQUAL, OPTIMAL
from rover_physics.prediction.map_sweep import score
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep import predict_poses
from rover_physics.results.path_prediction import BOUNDED_VALUES
from rover_physics.results.record import QUANTITIES
from rover_physics.traversability.verdict import hold_against_limits, refuse_worst_case
from rover_planner.planning.path_query import Candidate
from support.grounds import plane, raised, with_std
from support.paths import poses_at
from support.rovers import LSR1

POSES = poses_at(np.linspace(-0.2, 0.2, 5))
LEVEL = plane(0.0, 0.0)
DECISIVE = [name for name in BOUNDED_VALUES if name != "belly_clearance"]
EXTREMES = (
    0.0, 5e-324, 1e-310, 1e-300, 1e-155, 1e-20, 1e-9, 1e-6, 1e-3, 0.1, 10.0, 1e3, 1e6, 1e9, 1e20,
    1e154, 1e155, 1e300, 1.7e308, math.inf, math.nan,
)  # fmt: skip


def change_numbers(value, change, place=()):
    """Return a copy of nested dataclasses, dicts and tuples with change(place, number) for each.

    No check of a rover file is made.
    """
    if is_dataclass(value):
        inner = {field.name: getattr(value, field.name) for field in fields(value)}
        return replace(value, **change_numbers(inner, change, place))
    if isinstance(value, dict):
        return {name: change_numbers(one, change, (*place, name)) for name, one in value.items()}
    if isinstance(value, tuple):
        return tuple(change_numbers(one, change, (*place, k)) for k, one in enumerate(value))
    return change(place, value) if isinstance(value, float) else value


def with_number(rover, place, number):
    return change_numbers(rover, lambda at, value: number if at == place else value)


NUMBERS = []
"""Places of all numbers of the rover."""
change_numbers(LSR1, lambda place, value: NUMBERS.append(place) or value)


def assert_computed(prediction, verdict):
    """Check that a traversable path has numbers only."""
    assert not verdict.traversable or all(
        not np.isnan(getattr(prediction, name)).any() and np.isfinite(prediction.wheel_loads).all()
        for name in DECISIVE
    )


@settings(max_examples=120)
@given(
    places=st.lists(st.sampled_from(NUMBERS), min_size=1, max_size=3),
    number=st.sampled_from(EXTREMES),
    sign=st.sampled_from((1.0, 1.0, -1.0)),
    policy=st.sampled_from((EQUAL, OPTIMAL)),
)
def test_no_rover_of_extreme_numbers_passes_without_numbers(places, number, sign, policy):
    rover = LSR1
    for place in places:
        rover = with_number(rover, place, sign * number)
    try:
        prediction, verdict = judge_path(rover, LEVEL, POSES, SweepOptions(policy=policy))
    except RoverError:
        return
    assert_computed(prediction, verdict)
    scores = score_poses(rover, LEVEL, POSES, SweepOptions(policy=policy))
    assert not (scores.passable & ~np.isfinite(scores.least_load)).any()


@pytest.mark.parametrize(
    ("place", "number", "right"),
    [
        (("masses", "body", "mass"), 1.7e308, r"masses.body.mass is 1.7e\+308; .* at most 1e\+09"),
        (("gravity",), 1e-310, "gravity is 1e-310; it must be .* at least 1e-06 and"),
        (("wheel", "radius"), -1e200, "wheel.radius is -1e.200; it must .* least 0.001"),
        (("wheel", "width"), math.nan, "wheel.width is nan"),
    ],
)
def test_an_impossible_rover_is_refused_by_name_even_without_a_file(place, number, right):
    rover, options = with_number(LSR1, place, number), SweepOptions()
    for ask in (judge_path, score_poses, classify_path, find_torque_ranges):
        with pytest.raises(ModelError, match=right):
            ask(rover, LEVEL, POSES, options)


def test_a_pose_without_numbers_says_so_and_has_none_and_passes_nowhere():
    model = pack_model(LSR1, LEVEL)
    records = model.records.copy()
    records["linkage"]["gravity"] = math.inf  # which no check lets through
    model = replace(model, records=records)
    results = model.evaluate(POSES)
    assert (results["status"] == PoseStatus.NOT_COMPUTABLE).all()
    for one in QUANTITIES:
        if not (one.of_motion or one.of_path):
            assert np.isnan(results[one.name]).all(), one.name
    assert np.isnan(results["time"]).all() and np.isnan(results["energy"]).all()
    assert not score(model, POSES, (5,)).passable.any()
    motions = motions_of(model, POSES, np.zeros(5))
    verdict = hold_against_limits(LSR1, predict_poses(model, POSES, motions))
    assert verdict.code == "not_computable" and "not a finite number" in verdict.reason


@pytest.mark.parametrize("name", DECISIVE)
def test_a_nan_breaks_each_limit_and_names_the_quantity(name):
    prediction = judge_path(LSR1, LEVEL, POSES)[0]
    values = getattr(prediction, name).copy()
    values.reshape(len(POSES), -1)[3, -1] = math.nan
    verdict = hold_against_limits(LSR1, prediction.change(**{name: values}))
    assert not verdict.traversable and verdict.first_failure == 3
    assert verdict.code == "not_computable" and "cannot be computed" in verdict.reason


def test_a_bound_that_is_no_number_is_a_refusal():
    prediction, verdict = judge_path(LSR1, with_std(LEVEL, 1e-4), POSES)
    assert verdict.traversable and prediction.bounds is not None
    values = prediction.bounds.values.copy()
    values["wheel_loads"][2, 4, 0] = math.nan
    bounds = replace(prediction.bounds, values=values)
    worst = refuse_worst_case(LSR1, prediction, bounds, verdict)
    assert (worst.first_failure, worst.code) == (2, "not_computable")
    assert "wheel_loads" in worst.reason and "3 sigma" in worst.reason


def test_only_the_clearance_over_unknown_ground_may_be_unknown():
    # The wheels' tracks at y = -0.31 and 0.31 m stay known.
    ground = raised(LEVEL, np.s_[27:34], math.nan)
    narrow = replace(LSR1, belly=replace(LSR1.belly, y=(-0.1, 0.1)))
    for asked in (ground, with_std(ground, 1e-4)):
        prediction, verdict = judge_path(narrow, asked, POSES)
        assert np.isnan(prediction.belly_clearance).all() and verdict.traversable


def test_a_path_of_unknown_energy_costs_more_than_any_other():
    prediction, verdict = judge_path(LSR1, LEVEL, POSES)
    unknown = prediction.change(energy=np.full(len(POSES), math.nan))
    assert Candidate(POSES, unknown, verdict).cost == (math.inf, math.inf)


@given(*[st.floats()] * 6)
def test_no_ground_or_pose_passes_without_numbers(x, y, yaw, height, friction, resolution):
    elevation, layer = np.full((41, 41), height), np.full((41, 41), friction)
    try:
        ground = Terrain(elevation, resolution, (x, y), friction=layer)
        prediction, verdict = judge_path(LSR1, ground, [[x + 1.0, y + 1.0, yaw]])
    except RoverError:
        return
    assert_computed(prediction, verdict)
