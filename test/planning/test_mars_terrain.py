"""The terrain generator repeats itself, has the relief it was asked for and no hole."""

import numpy as np
import pytest

from rover_planner.errors import PlanningError
from rover_planner.worlds.mars_terrain import make_mars_terrain, make_relief


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


@pytest.mark.parametrize("hurst", [0.5, 0.8])
def test_relief_has_its_hurst_exponent_and_roughness(hurst):
    rng = np.random.default_rng(0)
    rms = np.zeros(3)
    for _ in range(4):
        relief = make_relief(rng, (400, 400), 0.1, hurst, 0.03)
        for k, lag in enumerate((5, 10, 20)):
            rms[k] += np.sqrt(np.mean((relief[:, lag:] - relief[:, :-lag]) ** 2)) / 4
    assert rms[1] == pytest.approx(0.03, rel=0.1)
    assert np.log2(rms[2] / rms[0]) / 2 == pytest.approx(hurst, abs=0.1)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"size": 0.0}, "size"),
        ({"size": "big"}, "size"),
        ({"size": (3.0, np.nan)}, "size"),
        ({"resolution": 0.0}, "resolution"),
        ({"size": 1e6}, "cells"),
        ({"hurst": 1.5}, "hurst"),
        ({"roughness": -1.0}, "roughness"),
        ({"crater_density": -1.0}, "crater density"),
        ({"crater_diameters": (2.0, 1.0)}, "crater diameters"),
        ({"rock_cover": 1.5}, "rock cover"),
        ({"rock_diameters": (0.0, 1.0)}, "rock diameters"),
    ],
)
def test_impossible_terrains_are_refused_by_name(change, names):
    arguments = {"seed": 0, "size": 4.0, "resolution": 0.1} | change
    with pytest.raises(PlanningError, match=names):
        make_mars_terrain(**arguments)
