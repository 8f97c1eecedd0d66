# SPDX-License-Identifier: Apache-2.0
"""A map of another frame is moved to that of the server, and no ground is made up."""

import numpy as np
import pytest

from rover_physics import Terrain
from rover_planner.errors import PlanningError
from rover_planner.maps.cells import CellGrid
from rover_planner.maps.layers import lay_onto
from rover_planner.maps.moved_map import MAX_LEAN, Move, move_map
from rover_planner.parameters.traverse_server import MERGE, TraverseServerParameters
from rover_planner.planning.answering.map_keeper import MapKeeper
from rover_planner.planning.navigation.transforms import Rigid
from support.grounds import make_terrain
from support.rovers import LSR1

CELL = 0.05
RNG = np.random.default_rng(5)


def move_of(x=0.0, y=0.0, z=0.0, roll=0.0, pitch=0.0, yaw=0.0) -> Move:
    return Rigid.from_rpy(x, y, z, roll, pitch, yaw).matrix


def rough_map(shape=(31, 40), origin=(3.0, -2.0)) -> Terrain:
    """Return noise with holes, deviations and friction."""
    z = RNG.normal(0.0, 0.1, shape)
    z[RNG.uniform(size=shape) < 0.1] = np.nan
    known = np.isfinite(z)
    std = np.where(known, RNG.uniform(0.01, 0.05, shape), np.nan)
    friction = np.where(known, RNG.uniform(0.4, 0.9, shape), np.nan)
    classes = RNG.integers(0, 3, shape).astype(float)
    return Terrain(z, CELL, origin, friction, elevation_std=std, ground_class=classes)


def test_a_shift_by_whole_cells_keeps_the_cells_of_the_grid_to_the_bit():
    local = rough_map()
    grid = CellGrid((-7.0, 4.0), CELL)
    higher = move_map(local, move_of(0.0, 0.0, 0.37))
    assert higher.elevation.tobytes() == (local.elevation + 0.37).tobytes()
    assert higher.elevation_std.tobytes() == local.elevation_std.tobytes()
    moved = move_map(local, move_of(17 * CELL, -123 * CELL), grid)
    before, after = lay_onto(local, grid), lay_onto(moved, grid)
    assert (after.box.row, after.box.column) == (before.box.row - 123, before.box.column + 17)
    assert before.layers.keys() == {"elevation", "elevation_std", "friction", "ground_class"}
    for name, layer in before.layers.items():
        assert after.layers[name].tobytes() == layer.tobytes()


def test_a_cell_has_the_height_of_the_four_around_it_and_is_known_only_if_they_are():
    local = rough_map()
    here = Rigid.from_rpy(-1.0, 2.0, 0.5, 0.0, 0.0, -2.4)
    moved = move_map(local, here.matrix)
    row, column = np.indices(moved.elevation.shape)
    at = np.stack([moved.origin[0] + CELL * column, moved.origin[1] + CELL * row, 0.0 * row], -1)
    back = here.inverse()
    own = back.rotation.apply(at.reshape(-1, 3)) + back.translation
    right = 0.5 + local.elevation_at(own[:, 0], own[:, 1]).reshape(row.shape)
    np.testing.assert_allclose(moved.elevation, right, atol=1e-12)
    known = np.isfinite(right)
    assert known.sum() > 400
    np.testing.assert_array_equal(np.isnan(moved.elevation_std), ~known)
    places = (own[known.ravel(), 1::-1] - local.origin[::-1]) / CELL
    nearest = np.rint(places).astype(int)
    is_sure = np.abs(places - nearest).max(axis=1) < 0.49
    for name in ("friction", "ground_class"):
        there = getattr(local, name)[tuple(nearest[is_sure].T)]
        np.testing.assert_array_equal(getattr(moved, name)[known][is_sure], there)


def test_a_turned_map_that_is_too_large_or_has_no_known_cell_is_refused():
    local = rough_map()
    with pytest.raises(PlanningError, match=r"would have \d+ x \d+ cells; at most 1000 are taken"):
        move_map(local, move_of(yaw=0.7), max_cells=1000)
    with pytest.raises(PlanningError, match=r"leans by 0\.05 rad \(roll and pitch\); it must be"):
        move_map(local, move_of(roll=0.03, pitch=0.04, yaw=1.0))
    assert move_map(local, move_of(pitch=0.99 * MAX_LEAN)).elevation.size
    checks = np.where(np.indices((20, 20)).sum(axis=0) % 2 == 0, 0.0, np.nan)
    with pytest.raises(PlanningError, match="none of them has four known ones around"):
        move_map(Terrain(checks, CELL), move_of(0.01, 0.02, yaw=0.3))


def test_a_turned_map_is_laid_onto_the_cells_that_it_merges_into_if_its_own_are_not_finer():
    prior = make_terrain(lambda x, y: 0.0 * x)
    keeper = MapKeeper(LSR1, TraverseServerParameters(map_updates=MERGE, fill_under_rover=False))
    keeper.load(prior, 0.0, None)
    local = make_terrain(lambda x, y: 0.02 * np.sin(x) + 0.02 * np.cos(y), half=1.0)
    placed = keeper.place(local, move_of(0.513, -0.237, 0.1, yaw=1.234))
    cells = np.subtract(placed.origin, prior.origin) / CELL
    np.testing.assert_allclose(cells, np.rint(cells), atol=1e-9)
    merged = keeper.take(placed, "elevation_map", 1.0, None).terrain
    assert merged.origin == prior.origin
    assert np.count_nonzero(merged.elevation) == np.isfinite(placed.elevation).sum() > 1000
    finer = keeper.place(Terrain(np.zeros((50, 50)), 0.01), move_of(yaw=0.6))
    assert finer.resolution == 0.01  # so that peaks stay
