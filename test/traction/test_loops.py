# SPDX-License-Identifier: Apache-2.0
"""Loops: limited outputs do not add up, changes keep their shares, slip does not hide rolling."""

import numpy as np
import pytest

from rover_planner.traction import loops


def moves(rate, wanted=0.3, suspension=(0.0, 0.0, 0.0, 0.0), progress=1.0):
    """Return wheels that all turn at a rate."""
    rates, ratios = np.full(6, rate), np.ones(6)
    return loops.WheelRates(rates, ratios, np.array(suspension), wanted, False, ratios, progress)


def test_a_push_that_cannot_be_given_does_not_add_up():
    free, held = loops.PIController(1.0, 10.0, 5.0), loops.PIController(1.0, 10.0, 5.0)
    for k in range(100):
        free.update(0.1, 0.02, False)
        held.update(0.1, 0.02, k > 10)
    assert free.update(0.0, 0.0, False) > 2.0 * held.update(0.0, 0.0, False)
    assert held.update(-0.1, 0.02, True) < held.update(0.0, 0.0, True) + 0.1


def test_rolling_goes_with_the_wheels_but_not_with_those_that_spin():
    ratios = np.array([1.0, 1.2, 0.8, 1.0, 1.0, 1.0])
    rates = 0.3 * ratios
    assert loops.estimate_rolling_rates(rates, ratios, 0.3) == pytest.approx(0.3 * ratios)
    rates[[2, 5]] = 9.0
    assert loops.estimate_rolling_rates(rates, ratios, 0.3) == pytest.approx(0.3 * ratios)
    spinning = loops.estimate_rolling_rates(np.full(6, 9.0), ratios, 0.3)
    assert spinning == pytest.approx(0.39 * ratios)


def test_servos_take_over_only_where_the_rover_does_not_get_on():
    detector, stands = loops.StallDetector(), moves(0.0)
    stands.rates[[2, 5]] = 9.0  # two wheels that spin hide nothing
    assert detector.update(moves(0.3), 5.0) == 0.0
    assert detector.update(stands, 0.4) == 0.0
    assert detector.stalled
    for _ in range(20):
        share = detector.update(stands, 0.1)
    assert share == 1.0
    assert detector.update(moves(0.3), 0.3) < 1.0


def test_a_rover_that_stands_while_its_wheels_turn_is_stalled():
    speed, detector = loops.BodySpeed(), loops.StallDetector()
    rng, shares = np.random.default_rng(0), []
    for k in range(200):
        hops = 1e-3 * rng.standard_normal(2)
        speed.take(np.array([min(k, 100) * 6e-4, 0.0]) + hops, 0.02 * k)
        progress = speed.speed / 0.03 if np.isfinite(speed.speed) else 1.0
        shares.append(detector.update(moves(0.3, progress=progress), 0.02))
    assert max(shares[:101]) == 0.0 < shares[-1]


def test_a_rover_that_climbs_slowly_is_left_to_the_program():
    detector, climbed = loops.StallDetector(), []
    detector.update(moves(0.3), 5.0)
    for k in range(200):
        slowly = moves(0.0, suspension=(0.0, 0.0, 0.003 * k, 0.0))
        assert detector.update(slowly, 0.02) == 0.0
        climbed.append(detector.climbs)
    assert sum(climbed) == 199 // (int(loops.CLIMBING_ANGLE / 0.003) + 1)


def test_servos_in_vain_leave_the_torques_to_the_program_again():
    detector = loops.StallDetector()
    shares = [detector.update(moves(0.0), 0.02) for _ in range(round(12.0 / 0.02))]
    taken = np.flatnonzero(np.diff(np.array(shares) == 1.0))
    assert len(taken) >= 3
    assert 0.02 * (taken[1] - taken[0]) == pytest.approx(loops.SERVO_TIME, abs=0.05)


def test_a_push_that_makes_wheels_slip_falls_until_they_do_not():
    loop = loops.PushLoop(1.0, 0.0, 50.0)
    assert loop.push(10.0, 0.02, False, 0.5) == 10.0
    for _ in range(20):
        push = loop.push(10.0, 0.02, False, 1.2)
    assert push < 1.0
    assert loop.push(-10.0, 0.02, False, 1.2) > -1.0
    for _ in range(200):
        push = loop.push(10.0, 0.02, False, 0.5)
    assert push == 10.0
