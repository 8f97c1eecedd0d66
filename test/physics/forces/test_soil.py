# SPDX-License-Identifier: Apache-2.0
"""The wheel-soil models against Wong's formulas worked by hand, their limits and their order."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rover_physics.forces.soil import (
    MIN_PULL,
    SHEAR_MODULUS,
    SoilWheel,
    contact_length,
    coulomb_slip,
    effective_friction,
    mobilised_share,
    pack_soils,
    shear_strength,
    solve_wheel,
)

MU = 0.8
RIGID = ("lunar_nominal", "mars_simulant", "dry_sand", "lete_sand")


def solve(soil, radius, width, N, T, S):
    return solve_wheel(soil, SoilWheel(radius, width, MU), N, T, S)


def friction_of(soil, radius, width, N, mu=MU):
    return effective_friction(soil, SoilWheel(radius, width, mu), N)


SOILS = {name: pack_soils((name,))[1] for name in (*RIGID, "firm_ground")}


# Worked from Wong's formulas by hand, with D = 2 r, k = k_c + b k_phi, x = i l / K:
#
# Dry sand, r = 0.5 m, b = 0.3 m, N = 2000 N; k = 990 + 0.3 x 1528430 = 459519 N/m^2.1
#   z0 = (3 x 2000 / (1.9 x 459519))^(2/3.2) = 0.006872174^0.625 = 0.04448195 m
#   R  = 459519 x 0.04448195^2.1 / 2.1 = 317.1541 N
#   l  = 0.5 arccos(1 - 0.04448195 / 0.5) = 0.5 arccos(0.9110361) = 0.2125032 m
#   A c + N tan(28 deg) = 0.3 l 1040 + 2000 x 0.5317094 = 66.30100 + 1063.4189 = 1129.7199 N
#   i = 0.2: x = 0.2 l / 0.025 = 1.700026; 1 - (1 - exp(-x)) / x = 0.5192301
#            F = 586.5846 N, F - R = 269.4305 N
#   i = 1:   x = 8.500128; 0.8823786; F = 996.8407 N, F - R = 679.6866 N


def test_the_model_gives_the_values_worked_by_hand():
    soil, wheel, N, pull = SOILS["dry_sand"], (0.5, 0.3), 2000.0, 269.4305
    result = solve(soil, *wheel, N, pull, 0.0)
    assert result.slip_ratio == pytest.approx(0.2, abs=2e-6)
    assert result.sinkage == pytest.approx(0.04448195, rel=1e-6)
    assert result.resistance == pytest.approx(317.1541, rel=1e-6)
    assert result.torque == pytest.approx(293.2923, rel=1e-5)
    assert result.utilisation == pytest.approx(pull / 679.6866, rel=5e-6)
    assert friction_of(soil, *wheel, N) == pytest.approx(679.6866 / N, rel=5e-6)


loads = st.floats(0.5, 2000.0)
names = st.sampled_from(RIGID)
wheels = st.tuples(st.floats(0.05, 0.6), st.floats(0.03, 0.5))


@given(names, wheels, loads, st.floats(-0.999, 0.999))
def test_slip_to_pull_and_back_is_the_same_slip(name, wheel, N, slip):
    """The thrust is (A c + N tan(phi)) (1 - K/il (1 - exp(-il/K)))."""
    soil, (r, b) = SOILS[name], wheel
    result = solve(soil, r, b, N, 0.0, 0.0)
    assume(result.sinkage < r)
    length = contact_length(r, result.sinkage)
    # Full slip of a long contact is the flat end of an exponential: digits of pull become slip.
    steepness = length / soil[SHEAR_MODULUS]
    thrust = mobilised_share(abs(slip) * steepness) * shear_strength(soil, b * length, N)
    pull = np.copysign(thrust, slip) - result.resistance
    again = solve(soil, r, b, N, pull, 0.0)
    if friction_of(soil, r, b, N) > MIN_PULL:
        assert again.utilisation <= 1.0
    assert again.slip_ratio == pytest.approx(slip, abs=1e-10 * (1.0 + steepness))


@given(names, wheels, loads, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_forces_within_the_effective_friction_are_within_the_strength(name, wheel, N, t, s):
    soil = SOILS[name]
    friction = friction_of(soil, *wheel, N)
    assume(friction > MIN_PULL)
    T, S = t * friction * N, s * friction * N
    result = solve(soil, *wheel, N, T, S)
    circle = math.hypot(t, s)
    assert result.utilisation <= circle * (1.0 + 1e-9) + 1e-12  # squares of tiny forces underflow
    thrust = math.hypot(T + result.resistance, S)
    strength = friction * N + result.resistance
    if abs(thrust / strength - 1.0) > 1e-9:
        assert (result.utilisation > 1.0) == (thrust > strength)
    assert -1.0 <= result.slip_ratio <= 1.0
    if friction > 1e-3 and circle > 1e-3:  # utilisation is the share of what this way allows
        T, S = T / result.utilisation, S / result.utilisation
        resistance = solve(soil, *wheel, N, T, S).resistance
        assert math.hypot(T + resistance, S) == pytest.approx(strength, rel=1e-9)


def test_a_wheel_that_cannot_pull_itself_may_still_be_dragged_unless_sunk_to_its_axle():
    soil = SOILS["mars_simulant"]
    sunk = solve(soil, 0.1, 0.08, 2000.0, 1.0, 0.0)
    assert sunk.sinkage > 0.1 and sunk.utilisation == np.inf
    assert sunk.resistance > 0.0 and friction_of(soil, 0.1, 0.08, 2000.0) == MIN_PULL
    wheel = (0.1, 0.08, 90.0)
    idle = solve(soil, *wheel, 0.0, 0.0)
    assert idle.sinkage < 0.1 and friction_of(soil, *wheel) == MIN_PULL
    assert idle.utilisation == np.inf and idle.slip_ratio == 1.0
    dragged = solve(soil, *wheel, -idle.resistance, 0.0)
    assert dragged.utilisation == 0.0 and dragged.slip_ratio == 0.0


@pytest.mark.parametrize(
    ("name", "N"), [(None, 0.0), ("dry_sand", 0.0), ("dry_sand", -5.0), ("lete_sand", math.nan)]
)
def test_a_lifted_wheel_has_no_grip(name, N):
    soil = pack_soils(default=name)[0]
    assert tuple(solve(soil, 0.1, 0.08, N, 2.0, 0.0)) == (1.0, 0.0, 0.0, 0.2, np.inf)
    if name is not None:
        assert friction_of(soil, 0.1, 0.08, N) == MIN_PULL


@given(st.floats(0.1, 1000.0), st.floats(-1000.0, 1000.0), st.floats(-1000.0, 1000.0))
def test_coulomb_ground_sticks_or_slips(N, T, S):
    soil = pack_soils()[0]
    slip, sinkage, resistance, torque, utilisation = solve(soil, 0.1, 0.08, N, T, S)
    assert (sinkage, resistance) == (0.0, 0.0)
    assert utilisation == pytest.approx(math.hypot(T, S) / (MU * N))
    assert torque == 0.1 * T
    assert slip == coulomb_slip(utilisation) == (0.0 if utilisation <= 1.0 else 1.0)
    assert friction_of(soil, 0.1, 0.08, N) == MU
