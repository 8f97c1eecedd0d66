# SPDX-License-Identifier: Apache-2.0
"""What a survey finds does not depend on its chunks, nor on ground beyond the rover's reach."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")

from rover_physics.traversability.judge import judge_poses
from rover_planner.survey.layers import unpack_bits
from rover_planner.survey.layout import choose_chunk, find_halo
from rover_planner.survey.tile_survey import survey_tile
from support.survey_maps import (
    assert_same_bits,
    layers_of,
    make_request,
    make_rough_map,
    survey_here,
)


def test_any_chunks_give_the_same_bits(tmp_path):
    terrain, request = make_rough_map(70, 140), make_request(headings=2)
    whole = layers_of(survey_here(tmp_path / "a", terrain, request, chunk=2000))
    assert len(np.unique(whole["first_limit"])) > 3
    parts = survey_here(tmp_path / "b", terrain, request, chunk=64)
    assert_same_bits(whole, layers_of(parts))


@pytest.mark.parametrize("step", [3, 100])
def test_steps_over_cells_do_not_depend_on_chunks_either(tmp_path, step):
    terrain, request = make_rough_map(), make_request(step=step)
    one = survey_here(tmp_path / "one", terrain, request, chunk=1)
    all_at_once = survey_here(tmp_path / "all", terrain, request, chunk=1000)
    assert len(one.job.layout.all_chunks) >= len(all_at_once.job.layout.all_chunks) == 1
    assert_same_bits(layers_of(one), layers_of(all_at_once))


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_ground_beyond_the_halo_is_not_looked_at(policy):
    request, terrain = make_request(policy=policy, turns=True), make_rough_map(120, 120)
    terrain = replace(terrain, origin=(0.0, 0.0))
    halo, first, end = find_halo(request.rover, terrain.resolution), 40, 80
    heights = np.full_like(terrain.elevation, np.nan)
    heights[:, 60:] = 5.0
    near = (slice(first - halo, end + halo),) * 2
    heights[near] = terrain.elevation[near]
    cells = np.arange(first, end, 3) * terrain.resolution
    places = np.stack(np.meshgrid(cells, cells), axis=-1).reshape(-1, 2)
    whole = survey_tile(request, terrain, places)
    assert_same_bits(whole, survey_tile(request, replace(terrain, elevation=heights), places))


def test_a_survey_is_what_predict_says_on_the_whole_map(tmp_path):
    terrain = make_rough_map()
    friction = np.where(np.arange(170) < 40, 0.2, np.nan) * np.ones((150, 1))
    soil = np.where(np.arange(150)[:, None] > 100, 0, -1) * np.ones((1, 170), np.int32)
    terrain = replace(
        terrain, friction=friction, soil=soil.astype(np.int32), soil_names=("dry_sand",)
    )
    request = make_request(step=5)
    layers = layers_of(survey_here(tmp_path, terrain, request, chunk=1))
    ny, nx = layers["first_limit"].shape
    x = terrain.origin[0] + 5 * terrain.resolution * np.arange(nx)
    y = terrain.origin[1] + 5 * terrain.resolution * np.arange(ny)
    grid = np.broadcast_arrays(x[:, None], y[:, None, None], request.yaws)
    poses = np.stack(grid, axis=-1).reshape(-1, 3)
    prediction, verdict = judge_poses(request.rover, terrain, poses, np.zeros(len(poses)))
    passes = np.array([not code for code in verdict.codes]).reshape(ny, nx, 4)
    found = unpack_bits(layers["passable_headings"], 4)
    # Coordinates round differently in the frame of a tile, and a survey passes over no hole.
    hole = terrain.elevation[::5, ::5]
    assert (found != passes).mean() < 0.01 and not np.isnan(hole).all()
    use = prediction.friction_utilisation.max(axis=1).reshape(ny, nx, 4)
    both = (found & passes).all(axis=2)
    close = np.isclose(layers["worst_friction_utilisation"], use.max(axis=2), rtol=1e-3)
    assert both.sum() > 100 and close[both].mean() > 0.98


def test_chunks_take_some_seconds_and_are_not_too_many():
    for shape in ((100, 100), (3200, 3200), (10_000, 10_000), (31_000, 31_000)):
        for headings in (8, 16):
            side = choose_chunk(shape, 1, headings)
            rows, columns = (-(-size // side) for size in shape)
            assert side % 64 == 0 and rows * columns <= 11_000
            assert side * side * headings < 1_000_000 or rows * columns > 5_000
