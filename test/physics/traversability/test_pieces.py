# SPDX-License-Identifier: Apache-2.0
"""Tests that pieces of path are judged as `judge_paths` judges them."""

import numpy as np
import pytest

from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_paths
from rover_physics.traversability.pieces import SAFE, find_exposure, judge_pieces
from support.rough_grounds import fractal, rocky

LSR1 = load_rover("lsr1")


def random_pieces(count, seed, half=2.0):
    """Return straight pieces, arcs, turns on the spot and pieces driven backwards."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        x, y, yaw = *rng.uniform(-half, half, 2), rng.uniform(-np.pi, np.pi)
        way = np.linspace(0.0, rng.uniform(0.2, 0.8), 30)
        bend = rng.choice([0.0, 0.0, rng.uniform(-1.5, 1.5)])
        if rng.random() < 0.2:
            found.append(np.column_stack([np.tile([x, y], (30, 1)), yaw + 1.2 * way]))
            continue
        yaws = yaw + bend * way
        steps = np.diff(way)[:, None] * np.column_stack([np.cos(yaws), np.sin(yaws)])[:-1]
        places = np.array([x, y]) + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
        back = np.pi if rng.random() < 0.3 else 0.0
        found.append(np.column_stack([places, yaws + back]))
    return found


@pytest.mark.parametrize(
    ("ground", "options"),
    [
        (fractal(3, roughness=0.05), SweepOptions()),
        (rocky(2), SweepOptions()),
        (fractal(4, roughness=0.09), SweepOptions(policy="servo")),
        (rocky(5, count=60), SweepOptions(policy="optimal", control_margin=0.3)),
        (fractal(6, roughness=0.05), SweepOptions(soil="mars_simulant")),
    ],
    ids=["fractal", "rocks", "servos", "margin", "soil"],
)
def test_a_piece_passes_where_its_path_does_and_costs_the_same(ground, options):
    pieces = random_pieces(60, 1)
    found = judge_pieces(LSR1, ground, pieces, options)
    judged = judge_paths(
        LSR1, ground, pieces, options, stop_at_failure=True, check_entrapment=False
    )
    passed = [verdict.traversable for _, verdict in judged]
    assert [not piece.code for piece in found] == passed
    assert 5 < sum(passed) < 60
    for piece, (prediction, verdict) in zip(found, judged, strict=True):
        if verdict.traversable:
            assert piece.time == pytest.approx(prediction.time[-1], rel=1e-6)
            assert piece.energy == pytest.approx(prediction.energy[-1], rel=1e-5, abs=1e-9)
            expected = find_exposure(LSR1, prediction)
            assert piece.exposure == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_exposure_is_zero_up_to_half_of_all_limits_and_the_whole_time_at_one():
    ground = fractal(1, roughness=1e-6)
    way = np.column_stack([np.linspace(0.0, 1.0, 51), np.zeros((51, 2))])
    prediction, verdict = judge_paths(LSR1, ground, [way])[0]
    assert verdict.risk < SAFE
    assert find_exposure(LSR1, prediction) == 0.0
    tight = LSR1.limits.__class__(**{**LSR1.limits.__dict__, "tip_over_ratio": 0.999})
    at_limit = type(LSR1)(**{**LSR1.__dict__, "limits": tight})
    exposure = find_exposure(at_limit, judge_paths(at_limit, ground, [way])[0][0])
    assert exposure == pytest.approx(prediction.time[-1], rel=0.01)
