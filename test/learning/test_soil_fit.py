# SPDX-License-Identifier: Apache-2.0
"""A drive over soil tells how it sinks, resists and holds; what it cannot tell, it says so."""

import numpy as np
import pytest

from rover_physics.errors import SoilError
from rover_physics.traction.balance import BalanceWriter
from rover_planner.learning.ground_learner import GroundLearner
from rover_planner.learning.soil_fit import SoilEstimate, SoilFit
from support.grounds import make_terrain
from support.learning_drives import drive_over_soil, scatter
from support.rovers import LSR1 as ROVER


def expect(soil: str) -> SoilEstimate:
    """Return what a soil is that was told and not driven on."""
    return SoilFit(ROVER, BalanceWriter(ROVER).weight, soil).find_estimate()


def learn(shape, told: str, seconds=80.0) -> SoilEstimate:
    """Return what a drive with noise over dry sand tells, of a shape z(x, y)."""
    ground = make_terrain(shape, half=2.6)
    rows = drive_over_soil(ROVER, ground, "dry_sand", seconds)
    scatter(rows, np.random.default_rng(0), 1e-3, 3e-3, 0.0, 0.03, 3e-3)
    learner = GroundLearner(ROVER, ground, soil=told)
    for row in rows:
        learner.take(row)
    return learner.estimate.soil


def test_sinkage_resistance_and_strength_are_learned_whatever_was_told():
    told = "mars_simulant"
    found, true = learn(lambda x, y: 0.05 * np.sin(2.1 * x + 4.0), told), expect("dry_sand")
    for name in ("sinkage", "resistance", "strength"):
        (mean, std), (value, _) = getattr(found, name), getattr(true, name)
        assert abs(getattr(expect(told), name)[0] / value - 1.0) > 0.06  # it was told wrong
        assert mean == pytest.approx(value, rel=0.12) and abs(mean - value) < 2.5 * std
    modulus = found.parameters["shear_modulus"]
    assert abs(modulus[0] - true.parameters["shear_modulus"][0]) < 2.5 * modulus[1]


def test_on_level_ground_resistance_is_told_and_strength_is_not():
    found = learn(lambda x, y: 0.0 * x, "lunar_nominal", 20.0)
    assert found.told_apart == ("modulus",)
    assert found.strength[1] > 0.1 * found.strength[0]


def test_without_a_drive_it_is_what_was_told_and_nothing_is_told_apart():
    found = expect("dry_sand")
    assert found.told_apart == () and found.trade == 0.0
    assert found.parameters["cohesion"][0] == pytest.approx(1040.0)
    assert found.parameters["friction_angle"][0] == pytest.approx(0.4887, abs=1e-4)
    assert found.sinkage[0] == pytest.approx(7.4e-3, abs=1e-4)  # docs/soil.md


def test_a_soil_that_does_not_yield_is_refused():
    with pytest.raises(SoilError, match="yield"):
        expect("firm_ground")
