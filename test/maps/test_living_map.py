# SPDX-License-Identifier: Apache-2.0
"""Local maps merge into a loaded one cell by cell; cells in which two maps differ are found."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import Terrain
from rover_planner.errors import PlanningError
from rover_planner.maps.cells import CellGrid
from rover_planner.maps.layers import LOADED, UNKNOWN, find_changes, lay_onto
from rover_planner.parameters.traverse_server import SUREST, TraverseServerParameters
from rover_planner.planning.answering.living_map import LivingMap
from support.grounds import make_terrain, waves

TOPIC = "elevation_cloud"
PRIOR = make_terrain(waves)


def local_map(origin, height=0.0, shape=(20, 20), resolution=0.05, std=None):
    elevation = np.full(shape, height)
    deviations = None if std is None else np.full(shape, std)
    return Terrain(elevation, resolution, origin, elevation_std=deviations)


def loaded(terrain=PRIOR, **rules) -> LivingMap:
    """Return a living map with a loaded one, and rules other than the defaults."""
    living = LivingMap(TraverseServerParameters(**rules))
    living.load(terrain, 0.0)
    return living


def cell(living, x, y):
    """Return height, name of source and time of the cell nearest to a point."""
    now = living.snapshot()
    terrain, sources = now.terrain, now.sources
    j = round((x - terrain.origin[0]) / terrain.resolution)
    i = round((y - terrain.origin[1]) / terrain.resolution)
    name = sources.names[sources.source[i, j]]
    return terrain.elevation[i, j], name, sources.time[i, j]


def test_a_loaded_map_alone_is_the_terrain_itself():
    living = LivingMap()
    living.load(PRIOR, 5.0)
    now = living.snapshot()
    assert now.terrain is PRIOR
    assert (now.sources.source == LOADED).all() and (now.sources.time == 5.0).all()
    only = local_map((0.0, 0.0), 0.1)
    living.replace(only, TOPIC, 1.0)
    now = living.snapshot()
    assert now.terrain is only and living.loaded is None
    # The watch waits for it.
    assert np.shares_memory(living._window.layers["elevation"], only.elevation)
    assert UNKNOWN not in now.sources.source


def test_a_loaded_map_survives_100_local_updates_to_the_bit():
    living = loaded()
    rng = np.random.default_rng(1)
    seen = np.zeros(PRIOR.elevation.shape, bool)
    for k in range(100):
        i, j = rng.integers(20, 120, 2)
        seen[i : i + 20, j : j + 20] = True
        origin = PRIOR.origin[0] + 0.05 * j, PRIOR.origin[1] + 0.05 * i
        living.merge(local_map(origin, height=1.0), TOPIC, 1.0 + k)
    merged = living.snapshot().terrain
    assert 0.1 < seen.mean() < 0.9
    assert merged.origin == PRIOR.origin and merged.resolution == PRIOR.resolution
    np.testing.assert_array_equal(merged.elevation, np.where(seen, 1.0, PRIOR.elevation))
    assert merged.elevation_std is None


@pytest.mark.parametrize("begin", [LivingMap.merge, LivingMap.replace])
@pytest.mark.parametrize(
    "maps",
    [
        # height, source and time of each map, and which of them is in the cell from then on
        [(0.1, TOPIC, 10.0, 0), (0.2, "rear", 9.0, 0), (0.3, "rear", 11.0, 2)],
        [(0.1, TOPIC, 1e9, 0), (0.2, TOPIC, 3.0, 1)],  # its clock went back
    ],
)
def test_the_newer_height_wins_whichever_arrives_last(maps, begin):
    living, take = LivingMap(), begin
    for height, source, time, winner in maps:
        take(living, local_map((0.0, 0.0), height), source, time)
        take = LivingMap.merge
        assert cell(living, 0.5, 0.5) == maps[winner][:3]


def test_the_surer_height_wins_until_it_has_aged():
    living = LivingMap(TraverseServerParameters(map_merge=SUREST, map_ageing=0.001))
    maps = [(0.1, 0.01, 0.0, 0.1), (0.2, 0.03, 10.0, 0.1), (0.3, 0.03, 40.0, 0.3)]
    for height, std, time, winner in [*maps, (0.4, 0.002, 41.0, 0.4)]:
        living.merge(local_map((0.0, 0.0), height, std=std), TOPIC, time)
        assert cell(living, 0.5, 0.5)[0] == winner
    np.testing.assert_array_equal(living.snapshot().terrain.elevation_std, 0.002)


@pytest.mark.parametrize(
    ("rules", "std"),
    [
        (TraverseServerParameters(map_merge=SUREST, loaded_std=0.5), 0.5),
        (TraverseServerParameters(), 0.0),
    ],
)
def test_a_loaded_map_without_deviations_gets_those_of_the_rules_or_stays_exact(rules, std):
    living = LivingMap(rules)
    living.load(PRIOR, 7.0)
    living.merge(local_map((0.0, 0.0), 0.3, std=0.02), TOPIC, 20.5)
    now = living.snapshot()
    assert cell(living, 0.5, 0.5) == (0.3, TOPIC, 20.5)
    assert cell(living, -0.5, -0.5)[1:] == ("loaded", 7.0)
    counts = now.sources.count()
    assert counts[TOPIC] == 400 and counts["loaded"] == PRIOR.elevation.size - 400
    assert set(np.unique(now.terrain.elevation_std)) == {0.02, std}


def test_a_map_grows_with_what_is_seen_and_keeps_its_cells():
    living = LivingMap()
    first = local_map((0.0, 0.0), 0.1)
    living.merge(first, TOPIC, 0.0)
    assert living.snapshot().terrain.bounds == first.bounds
    living.merge(local_map((3.0, -2.0), 0.2), TOPIC, 1.0)
    assert cell(living, 0.5, 0.5)[0] == 0.1 and cell(living, 3.5, -1.5)[0] == 0.2
    assert np.isnan(cell(living, 2.0, 0.0)[0])
    x, y = np.subtract(living.snapshot().terrain.origin, first.origin) / 0.05
    assert abs(x - round(x)) < 1e-9 and abs(y - round(y)) < 1e-9


def test_a_window_rolls_with_the_rover_and_takes_the_loaded_map_anew():
    living = loaded(map_window=2.0)
    for k in range(40):
        place = -2.0 + 0.1 * k, 0.0
        living.merge(local_map((place[0] - 0.5, -0.5), 1.0), TOPIC, 1.0 + k, place)
        terrain = living.snapshot().terrain
        assert terrain.elevation.shape == (40, 40)
        x0, x1, y0, y1 = terrain.bounds
        assert x0 + 0.5 < place[0] < x1 - 0.5 and y0 + 0.5 < place[1] < y1 - 0.5
    place = -2.0, 0.0
    # Back at the start, what left the window is the loaded map again.
    living.merge(local_map((-2.1, -0.1), 2.0, (4, 4)), TOPIC, 99.0, place)
    height, source, _ = cell(living, -2.5, 0.3)
    assert source == "loaded"
    assert height == pytest.approx(float(PRIOR.elevation_at(-2.5, 0.3)), abs=1e-6)
    living.values = TraverseServerParameters()  # without a window, all of it is there again
    living.merge(local_map((-2.1, -0.1), 2.0, (4, 4)), TOPIC, 100.0)
    assert cell(living, *PRIOR.origin) == (PRIOR.elevation[0, 0], "loaded", 0.0)


def test_a_loaded_map_stays_whole_until_the_first_local_map():
    living = loaded(map_window=2.0)
    patch = lay_onto(local_map((-4.5, 0.0), 0.1), living.grid)
    assert living.fill(patch, np.zeros((20, 20), bool), 1.0)
    terrain = living.snapshot().terrain
    assert terrain.contains(*PRIOR.bounds[1::2]) and terrain.contains(-4.5, 0.0)
    assert cell(living, -4.2, 0.5)[:2] == (0.1, "footprint")


def test_the_highest_of_several_finer_cells_counts():
    living = loaded(make_terrain(waves, 0.1))
    living.merge(local_map((-4.0, -4.0), 0.0, (40, 40), 0.1), TOPIC, 1.0)
    fine = np.zeros((80, 80))
    fine[41, 41] = 0.5
    living.merge(Terrain(fine, 0.02, (0.0, 0.0)), TOPIC, 2.0)
    assert living.snapshot().terrain.resolution == 0.1
    assert cell(living, 0.8, 0.8)[0] == 0.5 and cell(living, 0.6, 0.8)[0] == 0.0


def test_soil_friction_and_classes_stay_where_a_newer_map_has_none():
    shape = PRIOR.elevation.shape
    known = {"soil": np.ones(shape, np.int32), "soil_names": ("dry_sand", "loam")}
    known |= {"friction": np.full(shape, 0.4), "ground_class": np.full(shape, 2.0)}
    living = loaded(replace(PRIOR, **known))
    local = local_map((0.0, 0.0), 0.1)
    friction, classes = np.full((2, *local.elevation.shape), np.nan)
    friction[0, 0], classes[0, 0] = 0.5, 5.0
    living.merge(replace(local, friction=friction, ground_class=classes), TOPIC, 1.0)
    living.merge(local, TOPIC, 2.0)
    terrain = living.snapshot().terrain
    assert terrain.soil_names == known["soil_names"] and (terrain.soil == 1).all()
    for found, new, old in ((terrain.friction, 0.5, 0.4), (terrain.ground_class, 5.0, 2.0)):
        assert (found == new).sum() == 1 and (found == old).sum() == found.size - 1


def test_the_most_frequent_class_of_finer_cells_counts():
    fine = np.zeros((8, 8))
    fine[:4, :2], fine[:4, 2:4], fine[0, 0] = 1.0, np.nan, 9.0
    ground = Terrain(np.zeros((8, 8)), 0.25, (-0.375, -0.375), ground_class=fine)
    laid = lay_onto(ground, CellGrid((0.0, 0.0), 1.0)).layers["ground_class"]
    np.testing.assert_array_equal(laid, [[1.0, 0.0], [0.0, 0.0]])


def test_a_local_map_of_tiny_cells_is_refused_and_leaves_all_as_it_was():
    living = loaded(max_map_cells=1_000_000)
    with pytest.raises(PlanningError, match="max_map_cells is 1000000"):
        living.merge(local_map((0.0, 0.0), resolution=1e-5), TOPIC, 1.0)
    assert living.snapshot().terrain is PRIOR
    living.merge(local_map(PRIOR.origin, height=1.0), TOPIC, 2.0)
    assert living.snapshot().terrain.resolution == PRIOR.resolution
    assert cell(living, *PRIOR.origin)[:2] == (1.0, TOPIC)


def test_a_coarse_map_is_laid_only_onto_the_cells_of_a_window():
    orbital = Terrain(np.add.outer(np.arange(1000.0), np.arange(1000.0)), 1.0, (-500.0, -500.0))
    living = loaded(orbital, map_window=4.0)  # on cells of 1 cm it would have 1e10
    living.merge(local_map((0.0, 0.0), height=1.0, resolution=0.01), TOPIC, 1.0, (0.0, 0.0))
    assert living.snapshot().terrain.elevation.shape == (400, 400)
    height, source, _ = cell(living, 1.5, 1.25)
    assert height == pytest.approx(1002.75, abs=1e-9) and source == "loaded"
    living.merge(local_map((9.0, 9.0), resolution=0.01), TOPIC, 2.0, (9.0, 9.0))
    assert cell(living, 10.5, 9.25)[0] == pytest.approx(1019.75, abs=1e-9)
    living.merge(local_map((5e3, 5e3), resolution=0.01), TOPIC, 3.0, (5e3, 5e3))
    assert cell(living, 5000.05, 5000.05)[:2] == (0.0, TOPIC)


def test_a_window_of_too_many_cells_is_refused_with_one_that_fits():
    living = LivingMap(TraverseServerParameters(map_window=100.0, max_map_cells=10_000))
    with pytest.raises(PlanningError, match=r"map_window is 100 m, set it to at most 5 m"):
        living.merge(local_map((0.0, 0.0)), TOPIC, 1.0)
    assert living.grid is None
    living.values = TraverseServerParameters(map_window=5.0, max_map_cells=10_000)
    living.merge(local_map((0.0, 0.0)), TOPIC, 2.0)
    assert living.snapshot().terrain.elevation.shape == (100, 100)


def ground(seed=0, shape=(12, 15)) -> Terrain:
    rng = np.random.default_rng(seed)
    elevation = rng.standard_normal(shape)
    elevation[3, 4] = np.nan
    return Terrain(elevation, 0.1, (0.0, 0.0), friction=rng.uniform(0.2, 1.0, shape))


@pytest.mark.parametrize("layer", ["elevation", "friction"])
@pytest.mark.parametrize("value", [9.0, np.nan])
def test_a_cell_of_any_layer_that_differs_is_found(layer, value):
    assert not find_changes(ground(), ground()).any()
    assert find_changes(ground(shape=(4, 5)), ground())[5:].all()  # the map has grown
    values = getattr(ground(), layer).copy()
    values[7, 2] = value
    found = find_changes(ground(), replace(ground(), **{layer: values}))
    assert found.shape == (14, 17) and np.argwhere(found).tolist() == [[8, 3]]
    back = find_changes(replace(ground(), **{layer: values}), ground())
    assert np.argwhere(back).tolist() == [[8, 3]]
