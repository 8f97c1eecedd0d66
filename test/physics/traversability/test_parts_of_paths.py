# SPDX-License-Identifier: Apache-2.0
"""What changes no verdict: stopping at a failure, parts, pieces, a shift, more waypoints."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics import SweepOptions, Terrain, judge_path, judge_paths, judge_pieces, load_rover
from rover_physics.prediction import sweep
from rover_physics.prediction.packed_model import pack_model
from rover_physics.results.path_prediction import BOUNDED_VALUES
from rover_physics.results.record import QUANTITIES
from rover_physics.traversability.judge import PartwiseJudge
from rover_physics.traversability.pieces import SAFE, find_exposure
from rover_physics.traversability.verdict import hold_against_limits
from support.grounds import bouldered, bowl, fractal, make_terrain, rocky, scaled_for, with_std
from support.paths import arc_of, poses_at
from support.predictions import assert_same
from support.reference_drives import drive_ground, drive_path
from support.rovers import LSR1 as ROVER

GROUND = bouldered(3, half=6.0, count=600)
OPTIONS = {
    "equal": SweepOptions(),
    "slippery": SweepOptions(friction=0.35),
    "sand": SweepOptions(soil="dry_sand"),
    "backward": SweepOptions(friction=0.5, backward=True),
    "margin": SweepOptions(policy="optimal", control_margin=0.2, friction=0.45),
}


def straight(y: float, length=9.0, x=0.0, yaw=0.0, spacing=0.02) -> np.ndarray:
    """Return poses (n, 3) on a straight line with its middle at x, y."""
    along = np.arange(-0.5 * length, 0.5 * length, spacing)
    return arc_of(0.0, along, yaw) + poses_at(x, y)


@st.composite
def courses(draw) -> tuple[Terrain, np.ndarray]:
    """Return a rough ground, perhaps inclined or with unknown cells, and a path on it."""
    seed = draw(st.integers(0, 10_000))
    make = draw(st.sampled_from((bouldered, rocky, fractal)))
    ground = make(seed)
    rows, columns = np.mgrid[: ground.elevation.shape[0], : ground.elevation.shape[1]]
    rise = ground.elevation + ground.resolution * draw(st.floats(-0.5, 0.5)) * columns
    hole = draw(st.booleans()) & (np.hypot(rows - 40, columns - 90) < 6)
    ground = replace(ground, elevation=np.where(hole, np.nan, rise))
    places = st.floats(-0.7, 0.7)
    length, spacing = draw(st.floats(0.5, 3.9)), draw(st.sampled_from((0.01, 0.02, 0.05, 0.11)))
    yaw = draw(st.floats(-np.pi, np.pi))
    return ground, straight(draw(places), length, draw(places), yaw, spacing)


def first_refusal(verdict) -> tuple:
    return verdict.traversable, verdict.first_failure, verdict.code, verdict.reason


@settings(max_examples=15)
@given(courses(), st.sampled_from(sorted(OPTIONS)))
def test_a_stopped_sweep_is_the_beginning_of_the_whole_one_to_the_last_bit(course, option):
    ground, poses = course
    whole = judge_path(ROVER, ground, poses, OPTIONS[option])[0]
    verdict = hold_against_limits(ROVER, whole)
    model = pack_model(ROVER, ground, OPTIONS[option])
    swept = sweep.predict_paths(model, [poses], stop_at_failure=True)[0]
    stopped = hold_against_limits(ROVER, swept.prediction)
    assert first_refusal(stopped) == first_refusal(verdict)
    count = len(poses) if verdict.traversable else verdict.first_failure + 1
    assert len(swept.prediction.poses) == count
    assert_same(swept.prediction, whole.cut(count))
    assert_same(swept.prediction.between, whole.cut(count).between)
    assert stopped.codes == verdict.codes[:count]


STAIRS = make_terrain(lambda x, y: -0.16 * np.floor(np.maximum(x + 4.0, 0.0) / 0.4), 0.04, 6.0)
"""Stairs down along x, 0.4 m from edge to edge, so that wheels fall again and again."""
HALF_KNOWN = replace(GROUND, elevation=np.where(np.arange(301) > 200, np.nan, GROUND.elevation))
CASES = {
    "backwards": (GROUND, straight(-3.0)[::-1].copy(), SweepOptions(backward=True)),
    "slippery": (GROUND, straight(-1.0), SweepOptions(friction=0.4)),
    "margin": (GROUND, straight(3.0), SweepOptions("optimal", control_margin=0.3, friction=0.5)),
    "ledges": (STAIRS, straight(0.0), SweepOptions()),
    "unknown ground": (HALF_KNOWN, straight(-3.0), SweepOptions()),
    "uncertain": (with_std(GROUND, 0.003), straight(-3.0, 2.0), SweepOptions(friction=0.7)),
    "servos": (
        drive_ground("bump_one_side", 0.18),
        drive_path(),
        SweepOptions("servo", friction=1.0, max_torque=2.44),
    ),
    "trap": (bowl(0.37, 1.5, 0.35), straight(0.0, 10.0)[:250], SweepOptions(soil="dry_sand")),
}


def test_where_a_rover_fails_and_stays_while_a_wheel_goes_over_an_edge_its_path_ends():
    ledge = make_terrain(lambda x, y: np.where(x > 0.0, -0.15, 0.0), 0.02, 3.0)
    way = np.linspace(-0.8, 0.2, 251)
    whole = judge_path(ROVER, ledge, poses_at(way))[0]
    row = np.flatnonzero(whole.falling.any(axis=1))[1]
    limits = replace(ROVER.limits, tilt=0.999 * abs(whole.pitch[row]), wheel_drop=1.0)
    stays = poses_at(np.insert(way, row + 1, way[row] + 1e-4 * np.linspace(0.0, 1.0, 1500)))
    verdict = judge_path(replace(ROVER, limits=limits), ledge, stays, stop_at_failure=True)[1]
    assert (verdict.code, verdict.first_failure) == ("tilt", row)


@pytest.mark.parametrize("case", CASES)
def test_numbers_and_verdict_of_small_parts_are_those_of_the_whole_path(case, monkeypatch):
    monkeypatch.setattr(sweep, "PART", 17)
    terrain, poses, options = CASES[case]
    whole, verdict = judge_path(ROVER, terrain, poses, options)
    cut, stopped = judge_path(ROVER, terrain, poses, options, stop_at_failure=True)
    assert first_refusal(stopped) == first_refusal(verdict)
    judge = PartwiseJudge(ROVER, terrain, poses, options)
    taken = list(judge.parts())
    longest = max(len(part.poses) for part in taken)  # also where nothing settles
    assert longest <= 17 or case == "servos", "their drift looks far back"
    apart = 1e-9 if options.policy == "servo" else 0.0  # drift adds up in parts
    for name in ("poses", "status", *(one.name for one in QUANTITIES)):
        values = np.concatenate([getattr(part, name) for part in taken])
        np.testing.assert_allclose(values, getattr(whole, name), rtol=apart, err_msg=name)
    if whole.bounds:
        np.testing.assert_array_equal(cut.bounds.status, whole.bounds.status[: len(cut.poses)])
    for name in BOUNDED_VALUES if whole.bounds else ():
        values = np.concatenate([getattr(part.bounds, name) for part in taken])
        np.testing.assert_array_equal(values, getattr(whole.bounds, name), err_msg=name)
    assert judge.verdict().to_dict() == verdict.to_dict()
    assert (verdict.code == "trapped") == (case == "trap")


def random_pieces(count, seed, half=2.0):
    """Return straight pieces, arcs, turns on the spot and pieces driven backwards."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        x, y, yaw = *rng.uniform(-half, half, 2), rng.uniform(-np.pi, np.pi)
        way = np.linspace(0.0, rng.uniform(0.2, 0.8), 30)
        bend = rng.choice([0.0, 0.0, rng.uniform(-1.5, 1.5)])
        if rng.random() < 0.2:
            found.append(poses_at(x, y, yaw + 1.2 * way))
            continue
        back = np.pi if rng.random() < 0.3 else 0.0
        found.append(arc_of(bend, way, yaw) + poses_at(x, y, back))
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
    found = judge_pieces(ROVER, ground, pieces, options)
    judged = judge_paths(
        ROVER, ground, pieces, options, stop_at_failure=True, check_entrapment=False
    )
    passed = [verdict.traversable for _, verdict in judged]
    assert [not piece.code for piece in found] == passed
    assert 5 < sum(passed) < 60
    for piece, (prediction, verdict) in zip(found, judged, strict=True):
        if verdict.traversable:
            assert piece.time == pytest.approx(prediction.time[-1], rel=1e-6)
            assert piece.energy == pytest.approx(prediction.energy[-1], rel=1e-5, abs=1e-9)
            expected = find_exposure(ROVER, prediction)
            assert piece.exposure == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_exposure_is_zero_up_to_half_of_all_limits_and_the_whole_time_at_one():
    ground = fractal(1, roughness=1e-6)
    way = poses_at(np.linspace(0.0, 1.0, 51))
    prediction, verdict = judge_paths(ROVER, ground, [way])[0]
    assert verdict.risk < SAFE
    assert find_exposure(ROVER, prediction) == 0.0
    at_limit = replace(ROVER, limits=replace(ROVER.limits, tip_over_ratio=0.999))
    exposure = find_exposure(at_limit, judge_paths(at_limit, ground, [way])[0][0])
    assert exposure == pytest.approx(prediction.time[-1], rel=0.01)


@pytest.mark.parametrize(
    ("name", "make", "seed", "friction"),
    [("lsr1", rocky, 34, 1.0), ("lsr1", fractal, 830, 0.3), ("m2020", fractal, 230, 0.3)],
)
def test_twice_as_many_waypoints_change_no_verdict(name, make, seed, friction):
    """Each of them hid a peak of friction, or the begin of a fall, between its waypoints."""
    rover, rng = load_rover(name), np.random.default_rng(seed)
    yaw, (x, y) = rng.uniform(-np.pi, np.pi), rng.uniform(-0.4, 0.4, 2)
    terrain, path = scaled_for(rover, make(seed), straight(y, 1.0, x, yaw))
    middles = 0.5 * (path[1:] + path[:-1])
    refined = np.insert(path, np.arange(1, len(path)), middles, axis=0)
    coarse, fine = (
        judge_path(rover, terrain, poses, SweepOptions(friction=friction))[1]
        for poses in (path, refined)
    )
    assert coarse.traversable == fine.traversable
