"""Craters have the depth, rim and numbers that their sources give."""

import numpy as np
import pytest

from rover_planner.worlds import craters


def test_a_fresh_crater_is_a_fifth_as_deep_as_wide():
    r = np.linspace(0, 10, 2001)
    z = crater = craters.crater_profile(r, 4.0)
    assert z.max() - z.min() == pytest.approx(0.8, rel=1e-3)
    assert r[np.argmax(z)] == pytest.approx(2.0, abs=0.01)
    assert z.max() == pytest.approx(0.144, rel=1e-2)
    assert crater[r >= 6.0] == pytest.approx(0, abs=1e-12)
    assert np.abs(np.diff(z)).max() < 0.005


def test_crater_numbers_fall_with_the_square_of_their_diameter():
    diameters = craters.sample_diameters(np.random.default_rng(2), 0.5, 1e4, 1.0, 50.0)
    assert np.all(np.diff(diameters) <= 0)
    for diameter in (1.0, 2.0, 4.0):
        expected = 0.5 * 1e4 * (diameter**-2 - 50.0**-2)
        assert abs(np.sum(diameters >= diameter) - expected) < 4 * np.sqrt(expected)
