"""Samples of curves: the spline is that of scipy, the curve a cubic with a bump beside it."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from rover_planner.planning.curve_kernels import (
    BumpedCurve,
    follow_curve,
    interpolate,
    turns_within,
)


def test_the_spline_is_that_of_scipy():
    rng = np.random.default_rng(0)
    x, y = np.cumsum(rng.uniform(0.1, 1.0, 20)), rng.normal(size=20)
    slopes, at = rng.normal(size=20), np.linspace(x[0], x[-1], 333)
    values = np.empty(333)
    interpolate(at, x, y, slopes, values)
    assert values == pytest.approx(CubicHermiteSpline(x, y, slopes)(at), abs=1e-12)


def test_a_curve_is_the_cubic_through_its_ends_with_a_bump_beside_it():
    start, chord, left = np.array([1.0, 2.0]), np.array([4.0, 0.0]), np.array([0.0, 1.0])
    m0, m1 = np.array([3.0, 1.0]), np.array([5.0, -2.0])
    t = np.linspace(0.0, 1.0, 101)
    poses, slopes = np.empty((101, 3)), np.empty((2, 101))
    follow_curve(t, BumpedCurve(start, chord, m0, m1, left, 0.3), poses, slopes)
    cubic = CubicHermiteSpline([0.0, 1.0], [start, start + chord], [m0, m1])
    bump = 0.15 * (1.0 - np.cos(2.0 * np.pi * t))
    assert poses[:, :2] == pytest.approx(cubic(t) + bump[:, None] * left, abs=1e-12)
    rate = 0.3 * np.pi * np.sin(2.0 * np.pi * t)
    assert pytest.approx(cubic(t, 1) + rate[:, None] * left, abs=1e-12) == slopes.T


def test_an_arc_turns_within_its_own_radius_and_no_wider_one():
    angles = np.linspace(0.0, 1.0, 1001)
    slopes = 2.0 * np.array([-np.sin(angles), np.cos(angles)])
    speeds = np.hypot(*slopes)
    assert turns_within(slopes, speeds, 2.0)
    assert not turns_within(slopes, speeds, 2.001)
