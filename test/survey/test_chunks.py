# SPDX-License-Identifier: Apache-2.0
"""What a survey finds does not depend on its chunks, nor on ground beyond the rover's reach."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")

from rover_planner.survey.layout import choose_chunk, find_halo
from rover_planner.survey.tile_survey import survey_tile
from support.survey_maps import (
    assert_same_bits,
    layers_of,
    make_request,
    make_rough_map,
    survey_here,
)


@pytest.mark.parametrize(("step", "chunk"), [(1, 64), (3, 1), (100, 1)])
def test_any_chunks_give_the_same_bits(tmp_path, step, chunk):
    terrain, request = make_rough_map(70, 140), make_request(headings=2, step=step)
    soil = np.where(np.arange(70)[:, None] > 40, 0, -1) * np.ones((1, 140), np.int32)
    friction = np.where(np.arange(140) < 40, 0.2, np.nan) * np.ones((70, 1))
    terrain = replace(
        terrain, friction=friction, soil=soil.astype(np.int32), soil_names=("dry_sand",)
    )
    whole = survey_here(tmp_path / "whole", terrain, request, chunk=2000)
    parts = survey_here(tmp_path / "parts", terrain, request, chunk=chunk)
    assert len(parts.chunks) >= len(whole.chunks) == 1
    found = layers_of(whole)
    assert_same_bits(found, layers_of(parts))
    assert step > 1 or len(np.unique(found["first_limit"])) > 3
    x, y = (np.arange(0, count, step) * terrain.resolution for count in (140, 70))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    tile = survey_tile(request, replace(terrain, origin=(0.0, 0.0)), places)["first_limit"]
    assert (tile != found["first_limit"].ravel()).mean() < 1e-3  # coordinates round differently


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


def test_chunks_take_some_seconds_and_are_not_too_many():
    for shape in ((100, 100), (3200, 3200), (10_000, 10_000), (31_000, 31_000)):
        for headings in (8, 16):
            side = choose_chunk(shape, 1, headings)
            rows, columns = (-(-size // side) for size in shape)
            assert side % 64 == 0 and rows * columns <= 11_000
            assert side * side * headings < 1_000_000 or rows * columns > 5_000
