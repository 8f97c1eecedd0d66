# SPDX-License-Identifier: Apache-2.0
"""Compiled loops over the samples of a candidate's curve."""

from typing import NamedTuple

import numpy as np

from rover_physics.numerics.kernels import exact_kernel


@exact_kernel
def interpolate(at, x, y, slopes, values):
    """Evaluate the cubic Hermite spline through (x, y) with given slopes at ascending `at`.

    The result is written into `values`. scipy has this spline, but importing scipy.interpolate
    takes a tenth of the start time of a server.
    """
    i = 0
    for k in range(at.size):
        while i < x.size - 2 and x[i + 1] <= at[k]:
            i += 1
        width, rise = x[i + 1] - x[i], y[i + 1] - y[i]
        s = (at[k] - x[i]) / width
        first, last = slopes[i] * width - rise, rise - slopes[i + 1] * width
        values[k] = y[i] + s * rise + s * (1 - s) * ((1 - s) * first + s * last)


@exact_kernel
def turns_within(slopes, speeds, min_radius):
    """Return whether no radius of a curve is smaller than `min_radius` [m].

    Args:
        slopes: (2, 2 n - 1) first derivatives at n samples and half-way between them [m].
        speeds: (2 n - 1,) norms of the derivatives [m].
        min_radius: Smallest radius [m].
    """
    pieces = speeds.size // 2
    for k in range(0, 2 * pieces, 2):
        across = slopes[0, k] * slopes[1, k + 2] - slopes[1, k] * slopes[0, k + 2]
        along = slopes[0, k] * slopes[0, k + 2] + slopes[1, k] * slopes[1, k + 2]
        driven = 0.5 * (speeds[k + 2] + speeds[k]) / pieces
        if not abs(np.arctan2(across, along)) * min_radius <= driven * (1 + 1e-9):
            return False
    return True


class BumpedCurve(NamedTuple):
    """A Hermite cubic between two points plus a cosine bump; vectors (2,) in [m]."""

    start: np.ndarray
    """Where it begins."""
    chord: np.ndarray
    """Vector from the start to the end of the curve."""
    m0: np.ndarray
    """Tangent at the start."""
    m1: np.ndarray
    """Tangent at the end."""
    left: np.ndarray
    """Unit vector across the chord, to the left."""
    offset: float
    """Height of the bump to the left [m]."""


@exact_kernel
def follow_curve(t, curve, poses, slopes):
    """Write positions [m] into poses (n, 3) and first derivatives (2, n) at parameters t (n,)."""
    start, chord, m0, m1 = curve.start, curve.chord, curve.m0, curve.m1
    left, offset = curve.left, curve.offset
    for k in range(t.size):
        u, rest = t[k], 1 - t[k]
        sine, cosine = np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)
        for i in range(2):
            place = start[i] + u * u * (3 - 2 * u) * chord[i]
            place = place + u * (rest * rest) * m0[i] - u * u * rest * m1[i]
            poses[k, i] = place + 0.5 * offset * (1 - cosine) * left[i]
            slope = 6 * u * rest * chord[i]
            slope = slope + rest * (1 - 3 * u) * m0[i] + u * (3 * u - 2) * m1[i]
            slopes[i, k] = slope + np.pi * offset * sine * left[i]
