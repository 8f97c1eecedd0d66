# SPDX-License-Identifier: Apache-2.0
"""A survey finds what predict finds of a pose, whatever its chunks, and passes nothing unseen."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")

import zarr

from rover_physics import SweepOptions, Terrain, judge_poses
from rover_physics.terrain.layers import GRID_LAYERS
from rover_physics.traversability.pose_classes import IMPASSABLE, RoverOnMap, classify_poses
from rover_planner.survey.layers import (
    NO_LIMIT,
    list_layers,
    number_limits,
    pack_bits,
    unpack_bits,
)
from rover_planner.survey.layout import choose_chunk, find_halo
from rover_planner.survey.map_source import MAP, StoredMap, keep_map
from rover_planner.survey.tile_survey import outline_of, survey_tile
from support.grounds import raised
from support.rovers import LSR1
from support.survey_maps import (
    assert_same_bits,
    layers_of,
    make_request,
    make_rough_map,
    survey_here,
)

TOP_HEAVY = replace(
    LSR1, masses=replace(LSR1.masses, body=replace(LSR1.masses.body, com=(0.0, 0.0, 0.6)))
)


@pytest.fixture(scope="module")
def ground() -> Terrain:
    return make_rough_map(110, 110, (0.0, 0.0))


def places_on(terrain: Terrain, every=4) -> np.ndarray:
    ny, nx = terrain.elevation.shape
    x, y = (np.arange(0, n, every) * terrain.resolution for n in (nx, ny))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def with_layers(terrain: Terrain, columns: int, rows: int) -> Terrain:
    """Return the ground slippery in its first columns, and of sand from a row on."""
    friction = np.full(terrain.elevation.shape, np.nan)
    friction[:, :columns] = 0.2
    soil = np.full(terrain.elevation.shape, -1, np.int32)
    soil[rows:] = 0
    return replace(terrain, friction=friction, soil=soil, soil_names=("dry_sand",))


def poses_at(places: np.ndarray, request) -> np.ndarray:
    poses = np.empty((len(places), request.headings, 3))
    poses[:, :, :2], poses[:, :, 2] = places[:, None], request.yaws
    return poses.reshape(-1, 3)


def judged(request, terrain, poses, bend=0.0):
    return judge_poses(request.rover, terrain, poses, np.full(len(poses), bend), request.options)


def is_clear(terrain: Terrain, places: np.ndarray) -> np.ndarray:
    """Return whether no unknown cell is near places (n, 2), wherever the rover points."""
    rows, columns = np.nonzero(np.isnan(terrain.elevation))
    holes = terrain.resolution * np.column_stack([columns, rows])
    away = np.linalg.norm(places[:, None] - holes, axis=2).min(axis=1)
    return np.asarray(away > 1.0)


@pytest.mark.parametrize(
    ("policy", "std"), [("equal", None), ("servo", None), ("optimal", None), ("equal", 0.01)]
)
def test_limits_and_classes_are_those_of_predict(ground, policy, std):
    request = make_request(policy=policy, headings=1, rover=TOP_HEAVY)
    places = places_on(ground)
    if std is not None:
        std = np.where(np.isnan(ground.elevation), np.nan, std)
        ground, places = replace(ground, elevation_std=std), places[::5]
    else:  # layers of the ground count as in predict
        ground = with_layers(ground, 30, 81)
    layers, poses = survey_tile(request, ground, places), poses_at(places, request)
    verdict = judged(request, ground, poses)[1]
    clear = is_clear(ground, places)
    limits = np.array([number_limits()[code] for code in verdict.codes])
    np.testing.assert_array_equal(layers["first_limit"][clear], limits[clear])
    classes = classify_poses(RoverOnMap(TOP_HEAVY, ground, request.options), poses)
    classes[classes < 0] = IMPASSABLE  # ground that was not seen
    np.testing.assert_array_equal(layers["best_class"][clear], classes[clear])
    assert clear.any() and not clear.all()
    if std is None:
        assert {"tip_over", "belly", "tilt"} <= set(verdict.codes)
        assert len(set(classes.tolist())) >= 3
    else:
        exact = survey_tile(replace(request, sigmas=0.0), ground, places)["first_limit"]
        assert (layers["first_limit"] != NO_LIMIT).sum() > (exact != NO_LIMIT).sum()


def test_the_layers_sum_up_the_headings_of_each_cell_and_turns_to_both_sides(ground):
    request = make_request(turns=True)
    places = places_on(ground)
    layers, poses = survey_tile(request, ground, places), poses_at(places, request)
    prediction, verdict = judged(request, ground, poses)
    passes = np.array([not code for code in verdict.codes]).reshape(-1, 4)
    bits, clear = unpack_bits(layers["passable_headings"], 4), is_clear(ground, places)
    np.testing.assert_array_equal(bits[clear], passes[clear])
    assert not (bits & ~passes).any()
    np.testing.assert_array_equal(layers["best_class"] == 0, bits.any(axis=1))
    np.testing.assert_array_equal(layers["first_limit"] == NO_LIMIT, bits.all(axis=1))
    told = layers["worst_tilt"], -layers["worst_belly_clearance"]
    tilt = np.arccos(np.cos(prediction.roll) * np.cos(prediction.pitch))
    values = [one.reshape(-1, 4) for one in (tilt, -prediction.belly_clearance)]
    some = ~np.isnan(values[0]).all(axis=1)
    for worst, each in zip(told, values, strict=True):
        np.testing.assert_allclose(worst[some], np.nanmax(each[some], axis=1), 1e-6, 1e-7)
    assert np.isnan(layers["worst_tilt"][~some]).all() and (~some).any()
    worst, best = (layers[f"{one}_friction_utilisation"][some] for one in ("worst", "best"))
    assert (worst >= best).all()
    turns = unpack_bits(layers["turnable_headings"], 4)
    sides = [judged(request, ground, poses, bend)[1].codes for bend in (np.inf, -np.inf)]
    both = np.array([not (a or b) for a, b in zip(*sides, strict=True)]).reshape(-1, 4)
    np.testing.assert_array_equal(turns, bits & both)
    assert turns.any() and (bits & ~turns).any()


def test_the_chance_of_a_cell_is_that_of_its_headings_and_1_where_one_fails_as_told(ground):
    request, places = make_request(chance=True), places_on(ground)[::12]
    layers = survey_tile(request, ground, places)
    passes = unpack_bits(layers["passable_headings"], 4).ravel()
    poses, chances = poses_at(places, request), np.ones(len(passes), np.float32)
    for row in np.flatnonzero(passes):  # one by one: no pose counts for another one
        verdict = judge_poses(
            request.rover, ground, poses[row][None], options=request.options, accepted_chance=1.0
        )[1]
        chances[row] = verdict.failure_chance
    by_cell = chances.reshape(-1, 4)
    np.testing.assert_array_equal(layers["worst_failure_chance"], by_cell.max(axis=1))
    np.testing.assert_array_equal(layers["best_failure_chance"], by_cell.min(axis=1))
    assert ((chances > 0.0) & (chances < 1.0)).any() and (chances[passes] == 0.0).any()


def test_no_cell_passes_whose_outline_touches_unknown_ground():
    request = make_request(headings=16)
    ground = raised(Terrain(np.zeros((60, 60)), 0.05), (30, 30), np.nan)
    places = places_on(ground, 1)
    passes = unpack_bits(survey_tile(request, ground, places)["passable_headings"], 16)
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
    stands = judge_poses(request.rover, ground, [[1.5, 1.5, 0.0]], [0.0], SweepOptions())[1]
    assert stands.traversable  # the wheels stand beside the hole, where a survey does not pass


@pytest.mark.parametrize("headings", [4, 64])
def test_ground_that_is_all_unknown_is_impassable_in_layers_of_the_listed_types(headings):
    request = make_request(headings=headings, turns=True, chance=True)
    layers = survey_tile(request, None, np.zeros((5, 2)))
    assert (layers["best_class"] == IMPASSABLE).all()
    assert (layers["first_limit"] == number_limits()["unknown_ground"]).all()
    assert not layers["passable_headings"].any() and np.isnan(layers["worst_tilt"]).all()
    assert (layers["worst_failure_chance"] == 1.0).all()
    assert (layers["best_failure_chance"] == 1.0).all()
    listed = list_layers(headings, True, True)
    assert {k: v.dtype for k, v in layers.items()} == {k: v.dtype for k, v in listed.items()}


@pytest.mark.parametrize("headings", [1, 9, 64])
def test_bits_come_back(headings):
    flags = np.random.default_rng(headings).random((50, headings)) < 0.5
    bits = pack_bits(flags)
    assert bits.dtype.itemsize * 8 >= headings
    np.testing.assert_array_equal(unpack_bits(bits, headings), flags)


# Chunks


@pytest.mark.parametrize(("step", "chunk"), [(1, 32), (3, 1)])
def test_any_chunks_give_the_same_bits(tmp_path, step, chunk):
    request = make_request(headings=2, step=step)
    terrain = with_layers(make_rough_map(40, 50), 20, 26)
    whole = survey_here(tmp_path / "whole", terrain, request, chunk=2000)
    parts = survey_here(tmp_path / "parts", terrain, request, chunk=chunk)
    assert len(parts.chunks) >= len(whole.chunks) == 1
    found = layers_of(whole.store)
    assert_same_bits(found, layers_of(parts.store))
    assert step > 1 or len(np.unique(found["first_limit"])) > 3


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_ground_beyond_the_halo_is_not_looked_at(policy):
    request = make_request(policy=policy, turns=True)
    terrain = make_rough_map(120, 120, (0.0, 0.0))
    halo, first, end = find_halo(request.rover, terrain.resolution), 40, 80
    heights = np.full_like(terrain.elevation, np.nan)
    heights[:, 60:] = 5.0
    near = (slice(first - halo, end + halo),) * 2
    heights[near] = terrain.elevation[near]
    cells = np.arange(first, end, 3) * terrain.resolution
    places = np.stack(np.meshgrid(cells, cells), axis=-1).reshape(-1, 2)
    whole = survey_tile(request, terrain, places)
    assert_same_bits(whole, survey_tile(request, replace(terrain, elevation=heights), places))


def test_chunks_take_some_seconds_and_are_not_too_many():
    for shape in ((100, 100), (3200, 3200), (10_000, 10_000), (31_000, 31_000)):
        for headings in (8, 16):
            side = choose_chunk(shape, 1, headings)
            rows, columns = (-(-size // side) for size in shape)
            assert side % 64 == 0 and rows * columns <= 11_000
            assert side * side * headings < 1_000_000 or rows * columns > 5_000


def test_the_map_in_a_store_has_all_layers(ground):
    shape, box = ground.elevation.shape, np.s_[3:40, 5:60]
    classes = np.arange(ground.elevation.size, dtype=float).reshape(shape) % 7.0
    full = replace(
        with_layers(ground, 20, 30), elevation_std=np.full(shape, 0.01), ground_class=classes
    )
    group = zarr.create_group(zarr.storage.MemoryStore())
    keep_map(group, full)
    kept = StoredMap(group[MAP])
    assert kept.soil_names == full.soil_names
    for name, layer in kept.read(box).items():
        np.testing.assert_array_equal(layer, getattr(full, name)[box])
    assert kept.read(box).keys() == GRID_LAYERS.keys()
