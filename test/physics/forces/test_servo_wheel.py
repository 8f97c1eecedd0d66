# SPDX-License-Identifier: Apache-2.0
"""One wheel on a speed servo, on firm ground and on soil: its forces.

Their derivatives are in the Jacobian of test_servo.py.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from rover_physics.forces.servo_motion import SERVO
from rover_physics.forces.servo_soil import roll_on_soil
from rover_physics.forces.servo_wheel import S, T, roll_wheel
from rover_physics.forces.soil import (
    SHEAR_MODULUS,
    contact_length,
    find_sinkage,
    mobilised_share,
    motion_resistance,
    pack_soils,
    shear_strength,
)
from rover_physics.numerics.records import new_record

CREEP, FULL = 0.01, 0.2
RADIUS, WIDTH, WEIGHT = 0.1, 0.1, 80.0
SOILS = {
    name: pack_soils((name,))[-1]
    for name in ("lunar_nominal", "mars_simulant", "dry_sand", "lete_sand")
}
soils = st.sampled_from(sorted(SOILS))
ways = st.floats(-1.5, 1.5)
velocities = st.tuples(ways, ways, st.floats(-0.05, 0.05))
"""Speeds of a wheel along and across, and of its turn about the contact [nominal speeds]."""
grips = st.floats(1e-3, 0.5)
loads = st.floats(0.01, 0.4)
droops = st.floats(0.0, 0.9)
limits = st.floats(0.02, 0.5)
many = settings(max_examples=100)


def servo_of(limit, droop=0.3, share=1.0):
    """Return the SERVO of one wheel that is commanded to roll at the nominal speed."""
    servo = new_record(
        SERVO, droop=droop, full_traction=FULL, max_traction=limit, creep=CREEP,
        friction_share=share, radius=RADIUS, width=WIDTH, weight=WEIGHT,
    )  # fmt: skip
    servo.command[0] = 1.0
    return servo


def roll(grip, velocity, droop=0.3, limit=0.2):
    """Return the SERVO of a wheel on firm ground with the friction force `grip` [weights]."""
    servo = servo_of(limit, droop)
    roll_wheel(servo, 0, grip, velocity)
    return servo


def roll_soft(soil, load, velocity, droop=0.3, limit=0.2, share=1.0):
    """Return the SERVO of a wheel on soil with a load [weights]."""
    servo = servo_of(limit, droop, share)
    servo.soil[0], servo.load[0], servo.slip[0] = SOILS[soil], load, np.nan
    roll_on_soil(servo, 0, velocity)
    return servo


# Firm ground


def expected(grip, velocity, droop, limit) -> np.ndarray:
    """Return T, S, D by bisection."""
    along, across, spin = velocity
    wide = np.hypot(across, CREEP)

    def forces(slip):
        ends = np.array([slip + spin, slip - spin])
        size = np.hypot(ends, wide)
        pulls = -0.5 * grip * ends / size
        return np.array([pulls.sum(), -0.5 * grip * across * (1 / size).sum(), -np.diff(pulls)[0]])

    def excess(slip):
        return slip - (along - 1.0) - droop / FULL * forces(slip)[T]

    slip = brentq(excess, -10.0, 10.0, xtol=1e-15)
    if abs(forces(slip)[T]) > limit:
        most = np.copysign(limit, forces(slip)[T])
        slip = brentq(lambda s: forces(s)[T] - most, -1e4, 1e4, xtol=1e-15)
    return forces(slip)


@many
@given(grips, velocities, droops, limits)
def test_forces_are_those_of_servo_and_friction_law(grip, velocity, droop, limit):
    assume(abs(limit - grip) >= 1e-3 * grip)  # all friction along the wheel: slip is unbounded
    force = roll(grip, velocity, droop, limit).force[0]
    np.testing.assert_allclose(force, expected(grip, velocity, droop, limit), atol=1e-7)
    assert np.hypot(force[T], force[S]) <= grip + 1e-9
    assert abs(force[T]) <= limit + 1e-12


# Soil


def soil_forces(soil, load, velocity, rim) -> tuple[np.ndarray, float]:
    """Return F_x, S, D and R over the weight at the speed of the rim, by the notes on soil."""
    row, N = SOILS[soil], load * WEIGHT
    sinkage = find_sinkage(row, RADIUS, WIDTH, N)
    length = contact_length(RADIUS, sinkage)
    strength = shear_strength(row, WIDTH * length, N) / WEIGHT
    along, across, spin = velocity
    ends = []
    for way in (along + spin, along - spin):
        slide = np.array([rim - way, -across])
        size = np.hypot(*slide)
        slip = min(size / max(abs(rim), 1e-9), 1.0)
        share = mobilised_share(slip * length / row[SHEAR_MODULUS])
        ends.append(0.5 * strength * share * slide / max(size, 1e-12))
    resistance = motion_resistance(row, WIDTH, sinkage) / WEIGHT * np.clip(along / CREEP, -1, 1)
    shear = np.array([ends[0][0] + ends[1][0], ends[0][1] + ends[1][1], ends[0][0] - ends[1][0]])
    return shear, resistance


@many
@given(soils, loads, velocities, droops, st.floats(0.5, 1.0))
def test_forces_are_those_of_servo_and_soil(soil, load, velocity, droop, share):
    servo = roll_soft(soil, load, velocity, droop, 10.0, share)

    def excess(rim):
        shear, resistance = soil_forces(soil, load, velocity, rim)
        thrust = share * (shear[0] - resistance) + resistance
        return rim - 1.0 + droop / FULL * thrust

    rim = brentq(excess, -50.0, 50.0, xtol=1e-14)
    assume(abs(rim) > 0.05)  # where the rim stands, a creep keeps the slip regular
    shear, resistance = soil_forces(soil, load, velocity, rim)
    assert velocity[0] - servo.slip[0] == pytest.approx(rim, abs=1e-8)
    forces = share * (shear - [resistance, 0.0, 0.0])
    np.testing.assert_allclose(servo.force[0], forces, atol=1e-7)
