# SPDX-License-Identifier: Apache-2.0
"""Made terrain repeats itself and has relief, craters and rocks as their sources give them."""

import numpy as np
import pytest

from rover_planner.errors import PlanningError
from rover_planner.worlds import mars_terrain
from rover_planner.worlds.mars_terrain import HURST, make_mars_terrain, make_relief


def test_the_same_seed_makes_the_same_terrain_and_another_seed_another():
    first = make_mars_terrain(3, size=8.0)
    assert np.array_equal(first.elevation, make_mars_terrain(3, size=8.0).elevation)
    assert np.isfinite(first.elevation).all()
    xmin, xmax, ymin, ymax = first.bounds
    assert xmin + xmax == pytest.approx(0, abs=1e-9) == ymin + ymax
    assert not np.allclose(first.elevation, make_mars_terrain(4, size=8.0).elevation)


def test_more_rocks_do_not_move_the_hills():
    bare = make_mars_terrain(5, size=10.0, rock_cover=0.0)
    rocky = make_mars_terrain(5, size=10.0, rock_cover=0.1)
    difference = rocky.elevation - bare.elevation
    # apart from the shift to zero mean, most cells are untouched
    assert np.mean(np.abs(difference - np.median(difference)) < 1e-12) > 0.8
    assert difference.max() - np.median(difference) > 0.05


def test_relief_has_its_hurst_exponent_and_roughness():
    rng = np.random.default_rng(0)
    rms = np.zeros(3)
    for _ in range(4):
        relief = make_relief(rng, 400, 0.1, 0.03)
        for k, lag in enumerate((5, 10, 20)):
            rms[k] += np.sqrt(np.mean((relief[:, lag:] - relief[:, :-lag]) ** 2)) / 4
    assert rms[1] == pytest.approx(0.03, rel=0.1)
    assert np.log2(rms[2] / rms[0]) / 2 == pytest.approx(HURST, abs=0.1)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"seed": -1}, "seed"),
        ({"size": 0.0}, "size"),
        ({"resolution": 0.0}, "resolution"),
        ({"size": 1e6}, "cells"),
        ({"roughness": -1.0}, "roughness"),
        ({"crater_density": -1.0}, "crater density"),
        ({"rock_cover": 1.5}, "rock cover"),
    ],
)
def test_impossible_terrains_are_refused_by_name(change, names):
    arguments = {"seed": 0, "size": 4.0, "resolution": 0.1} | change
    with pytest.raises(PlanningError, match=names):
        make_mars_terrain(**arguments)


def test_a_fresh_crater_is_a_fifth_as_deep_as_wide():
    r = np.linspace(0, 10, 2001)
    z = crater = mars_terrain.crater_profile(r, 4.0)
    assert z.max() - z.min() == pytest.approx(0.8, rel=1e-3)
    assert r[np.argmax(z)] == pytest.approx(2.0, abs=0.01)
    assert z.max() == pytest.approx(0.144, rel=1e-2)
    assert crater[r >= 6.0] == pytest.approx(0, abs=1e-12)
    assert np.abs(np.diff(z)).max() < 0.005


def test_crater_numbers_fall_with_the_square_of_their_diameter():
    diameters = np.sort(mars_terrain.draw_craters(np.random.default_rng(2), 0.5, 1e4, 50.0))[::-1]
    assert np.all(np.diff(diameters) <= 0)
    for diameter in (1.0, 2.0, 4.0):
        expected = 0.5 * 1e4 * (diameter**-2 - 50.0**-2)
        assert abs(np.sum(diameters >= diameter) - expected) < 4 * np.sqrt(expected)


@pytest.mark.parametrize("k", [0.02, 0.19])
def test_number_of_rocks_integrates_to_the_area_they_cover(k):
    edges = np.geomspace(0.05, 3.0, 3000)
    numbers = -np.diff(mars_terrain.count_rocks(k, edges, 3.0))
    middles = 0.5 * (edges[1:] + edges[:-1])
    area = np.sum(numbers * np.pi / 4 * middles**2)
    # F_k(D), the fraction of the ground covered by rocks of a diameter and larger.
    small, large = k * np.exp(-(1.79 + 0.152 / k) * np.array([0.05, 3.0]))
    assert area == pytest.approx(small - large, rel=1e-4)


def test_drawn_rocks_follow_the_size_frequency_law():
    k, area, smallest, largest = 0.1, 20_000.0, 0.1, 2.0
    diameters = mars_terrain.draw_rocks(np.random.default_rng(7), k, area, smallest, largest)
    assert diameters.min() >= smallest
    assert diameters.max() <= largest
    for diameter in (0.1, 0.15, 0.2, 0.3, 0.5):
        expected = mars_terrain.count_rocks(k, np.array([diameter]), largest)[0] * area
        counted = np.sum(diameters >= diameter)
        assert abs(counted - expected) < 4 * np.sqrt(expected) + 1


def test_rocks_that_are_too_rare_to_be_counted_are_none():
    rng = np.random.default_rng(1)
    for k in np.geomspace(2.0e-5, 2.1e-5, 100):
        assert len(mars_terrain.draw_rocks(rng, k, 400.0, 0.1, 1.5)) == 0


def test_a_rock_is_half_as_high_as_wide():
    elevation = np.full((81, 81), 1.0)
    mars_terrain.add_rocks(elevation, 0.01, np.array([40.0]), np.array([40.0]), np.array([0.4]))
    assert elevation.max() == pytest.approx(1.2)
    assert np.sum(elevation > 1.0) * 1e-4 == pytest.approx(np.pi * 0.04, rel=0.02)


def test_a_rock_smaller_than_a_cell_or_at_the_edge_does_no_harm():
    elevation = np.zeros((5, 5))
    mars_terrain.add_rocks(
        elevation, 1.0, np.array([1.4, 0.0]), np.array([2.4, 0.0]), np.array([0.2, 3])
    )
    assert np.isfinite(elevation).all()
    assert elevation[0, 0] == pytest.approx(1.5)
