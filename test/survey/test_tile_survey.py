"""A survey finds of each pose what predict finds of it, and never passes over unknown ground."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import classify_judged
from rover_physics.traversability.judge import judge_poses
from rover_planner.survey.layers import (
    CLASS_NUMBERS,
    LIMIT_NUMBERS,
    NO_LIMIT,
    pack_bits,
    types_of_layers,
    unpack_bits,
)
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.tile_survey import TileJudge, outline_of, survey_tile
from support.survey_maps import make_request, make_rough_map

HEADINGS = 4


@pytest.fixture(scope="module")
def ground() -> Terrain:
    return replace(make_rough_map(110, 110), origin=(0.0, 0.0))


def places_on(terrain: Terrain, every=3) -> np.ndarray:
    ny, nx = terrain.elevation.shape
    x, y = (np.arange(0, n, every) * terrain.resolution for n in (nx, ny))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def poses_at(places: np.ndarray, request: SurveyRequest) -> np.ndarray:
    poses = np.empty((len(places), request.headings, 3))
    poses[:, :, :2], poses[:, :, 2] = places[:, None], request.yaws
    return poses.reshape(-1, 3)


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_limits_and_classes_are_those_of_predict(ground, policy):
    request = make_request(policy=policy)
    rover = request.rover
    top_heavy = replace(rover.masses.body, com=(0.0, 0.0, 0.6))
    rover = replace(rover, masses=replace(rover.masses, body=top_heavy))
    request = replace(request, rover=rover)
    poses = poses_at(places_on(ground), request)
    straight = np.zeros(len(poses))
    prediction, verdict = judge_poses(request.rover, ground, poses, straight, request.options)
    classified = classify_judged(
        request.rover, ground, prediction, verdict, request.options, curvature=straight
    )
    judge = TileJudge(request, ground)
    _, limits = judge.judge(policy, poses, 0.0)
    assert limits.tolist() == [LIMIT_NUMBERS[code] for code in verdict.codes]
    assert {"tip_over", "belly", "tilt", "suspension", "off_map"} < set(verdict.codes)
    classes = judge._classify(poses, limits, np.zeros(len(poses), bool))
    assert classes.tolist() == [CLASS_NUMBERS[one.traversability_class] for one in classified]
    assert len(set(classes.tolist())) >= 3


def test_the_layers_sum_up_the_headings_of_each_cell(ground):
    request = make_request(turns=True)
    places = places_on(ground)
    layers = survey_tile(request, ground, places)
    poses = poses_at(places, request)
    prediction, verdict = judge_poses(
        request.rover, ground, poses, np.zeros(len(poses)), request.options
    )
    unknown = TileJudge(request, ground)._find_unknown_below(poses)
    passes = ~np.array([bool(code) for code in verdict.codes]) & ~unknown
    passes = passes.reshape(-1, HEADINGS)
    bits = unpack_bits(layers["passable_headings"], HEADINGS)
    np.testing.assert_array_equal(bits, passes)
    np.testing.assert_array_equal(layers["best_class"] == 0, passes.any(axis=1))
    np.testing.assert_array_equal(layers["first_limit"] == NO_LIMIT, passes.all(axis=1))
    tilt = np.arccos(np.cos(prediction.roll) * np.cos(prediction.pitch)).reshape(-1, HEADINGS)
    some = ~np.isnan(tilt).all(axis=1)
    np.testing.assert_allclose(
        layers["worst_tilt"][some], np.nanmax(tilt[some], axis=1), rtol=1e-6, atol=1e-7
    )
    clearance = prediction.belly_clearance.reshape(-1, HEADINGS)[some]
    np.testing.assert_allclose(
        layers["worst_belly_clearance"][some], np.nanmin(clearance, axis=1), rtol=1e-6
    )
    assert np.isnan(layers["worst_tilt"][~some]).all() and (~some).any()
    assert (layers["worst_friction_utilisation"] >= layers["best_friction_utilisation"])[
        some
    ].all()
    turns = unpack_bits(layers["turnable_headings"], HEADINGS)
    assert turns.any() and not (turns & ~passes).any() and (passes & ~turns).any()


def test_a_turn_is_judged_to_both_sides(ground):
    request = make_request(turns=True)
    poses = poses_at(places_on(ground, 5), request)
    codes = [
        judge_poses(request.rover, ground, poses, np.full(len(poses), bend))[1].codes
        for bend in (0.0, np.inf, -np.inf)
    ]
    judge = TileJudge(request, ground)
    passes = np.array([not code for code in codes[0]])
    both = passes & np.array([not (a or b) for a, b in zip(*codes[1:], strict=True)])
    np.testing.assert_array_equal(judge._find_turns(poses, passes), both)


def test_no_cell_passes_whose_outline_touches_unknown_ground():
    request = make_request(headings=16)
    heights = np.zeros((60, 60))
    heights[30, 30] = np.nan
    ground = Terrain(heights, 0.05)
    places = places_on(ground, 1)
    layers = survey_tile(request, ground, places)
    passes = unpack_bits(layers["passable_headings"], 16)
    rear, front, right, left = outline_of(request.rover)
    hole, half = np.array([1.5, 1.5]), 0.025
    touched = 0
    for k, yaw in enumerate(request.yaws):
        c, s = np.cos(yaw), np.sin(yaw)
        for corner in ((-half, -half), (-half, half), (half, -half), (half, half), (0.0, 0.0)):
            away = hole + corner - places
            along, across = away @ (c, s), away @ (-s, c)
            inside = (along >= rear) & (along <= front) & (across >= right) & (across <= left)
            touched += inside.sum()
            assert not passes[inside, k].any()
    assert touched > 1000 and passes.any()
    stands = judge_poses(request.rover, ground, [[1.5, 1.5, 0.0]], [0.0])[1]
    assert (
        stands.traversable
    )  # the wheels stand beside the hole: predict passes, a survey does not


def test_ground_that_is_all_unknown_is_impassable():
    request = make_request(turns=True)
    layers = survey_tile(request, None, np.zeros((5, 2)))
    assert (layers["best_class"] == CLASS_NUMBERS["impassable"]).all()
    assert (layers["first_limit"] == LIMIT_NUMBERS["unknown_ground"]).all()
    assert not layers["passable_headings"].any() and np.isnan(layers["worst_tilt"]).all()
    assert {name: layer.dtype for name, layer in layers.items()} == types_of_layers(4, True)


def test_uncertain_heights_refuse_what_predict_refuses(ground):
    std = np.where(np.isnan(ground.elevation), np.nan, 0.01)
    uncertain = replace(ground, elevation_std=std)
    request = make_request()
    poses = poses_at(places_on(ground, 9), request)
    codes = judge_poses(request.rover, uncertain, poses, np.zeros(len(poses)))[1].codes
    limits = TileJudge(request, uncertain).judge("equal", poses, 0.0)[1]
    assert limits.tolist() == [LIMIT_NUMBERS[code] for code in codes]
    prediction, verdict = judge_poses(request.rover, uncertain, poses, np.zeros(len(poses)))
    classified = classify_judged(
        request.rover, uncertain, prediction, verdict, curvature=np.zeros(len(poses))
    )
    classes = TileJudge(request, uncertain)._classify(poses, limits, np.zeros(len(poses), bool))
    assert classes.tolist() == [CLASS_NUMBERS[one.traversability_class] for one in classified]
    exact = TileJudge(replace(request, sigmas=0.0), uncertain).judge("equal", poses, 0.0)[1]
    assert (limits > 0).sum() > (exact > 0).sum()


@pytest.mark.parametrize("headings", [1, 8, 9, 16, 33, 64])
def test_bits_come_back(headings):
    flags = np.random.default_rng(headings).random((50, headings)) < 0.5
    bits = pack_bits(flags)
    assert bits.dtype.itemsize * 8 >= headings
    np.testing.assert_array_equal(unpack_bits(bits, headings), flags)
