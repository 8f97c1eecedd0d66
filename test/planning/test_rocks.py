"""Rocks follow the size-frequency law and have the shape that it comes with."""

import numpy as np
import pytest

from rover_planner.errors import PlanningError
from rover_planner.worlds import rocks


def test_rock_law_has_the_published_decay():
    assert rocks.decay_rate(0.19) == pytest.approx(2.59)
    assert rocks.decay_rate(0.03) == pytest.approx(6.8567, abs=1e-4)


@pytest.mark.parametrize("k", [0.02, 0.07, 0.19])
def test_number_of_rocks_integrates_to_the_area_they_cover(k):
    edges = np.geomspace(0.05, 3.0, 3000)
    numbers = -np.diff(rocks.cumulative_number(k, edges, 3.0))
    middles = 0.5 * (edges[1:] + edges[:-1])
    area = np.sum(numbers * np.pi / 4 * middles**2)
    expected = rocks.cumulative_area(k, 0.05) - rocks.cumulative_area(k, 3.0)
    assert area == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("k", [0.03, 0.1])
def test_drawn_rocks_follow_the_size_frequency_law(k):
    area, smallest, largest = 20_000.0, 0.1, 2.0
    diameters = rocks.sample_diameters(np.random.default_rng(7), k, area, smallest, largest)
    assert diameters.min() >= smallest
    assert diameters.max() <= largest
    for diameter in (0.1, 0.15, 0.2, 0.3, 0.5):
        expected = rocks.cumulative_number(k, np.array([diameter]), largest)[0] * area
        counted = np.sum(diameters >= diameter)
        assert abs(counted - expected) < 4 * np.sqrt(expected) + 1
        areas = np.pi / 4 * diameters[diameters >= diameter] ** 2
        law = rocks.cumulative_area(k, diameter) - rocks.cumulative_area(k, largest)
        assert abs(areas.sum() / area - law) < 4 * np.sqrt(np.sum(areas**2)) / area


def test_a_rock_is_half_as_high_as_wide():
    elevation = np.full((81, 81), 1.0)
    rocks.add_rocks(elevation, 0.01, np.array([40.0]), np.array([40.0]), np.array([0.4]))
    assert elevation.max() == pytest.approx(1.2)
    assert np.sum(elevation > 1.0) * 1e-4 == pytest.approx(np.pi * 0.04, rel=0.02)


def test_a_rock_smaller_than_a_cell_or_at_the_edge_does_no_harm():
    elevation = np.zeros((5, 5))
    rocks.add_rocks(elevation, 1.0, np.array([1.4, 0.0]), np.array([2.4, 0.0]), np.array([0.2, 3]))
    assert np.isfinite(elevation).all()
    assert elevation[0, 0] == pytest.approx(1.5)


def test_more_rocks_than_can_be_made_are_refused():
    with pytest.raises(PlanningError, match=r"rock cover is 0\.9, which are .* rocks"):
        rocks.sample_diameters(np.random.default_rng(1), 0.9, 1e6, 0.01, 1.5)
