"""Peaks inside a twisted cell: where they may be, seen from the heading of a wheel."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rover_physics.contact.cell_peaks import span_of_peaks

slopes = st.floats(-1.0, 1.0)
headings = st.tuples(st.integers(0, 3), st.floats(0.03, 0.97))


@settings(max_examples=100, deadline=None)
@given(st.tuples(slopes, slopes, slopes), st.floats(0.01, 1.0), headings, st.floats(-2.0, 2.0))
def test_the_best_place_across_is_in_the_cell_just_where_the_span_says(slope, bend, heading, s):
    """The ground is b u + c v + d u v on a cell of side 1; `tilt` is the slope of the axle."""
    yaw = 0.5 * np.pi * sum(heading)
    ex, ey = np.cos(yaw), np.sin(yaw)
    b, c, tilt = slope
    d = bend / (ex * ey)  # so the ground bends down across the heading

    def place(t):
        return ex * s - ey * t, ey * s + ex * t

    def intrusion(t):
        u, v = place(t)
        return b * u + c * v + d * u * v - tilt * t

    right, middle, left = intrusion(-1.0), intrusion(0.0), intrusion(1.0)
    best = 0.5 * (left - right) / (2.0 * middle - left - right)
    assert intrusion(best) >= max(intrusion(best - 0.1), intrusion(best + 0.1))
    inside = min(*place(best), *(1.0 - np.array(place(best))))
    assume(abs(inside) > 1e-6)
    least, most = span_of_peaks((c * ex - b * ey - tilt) / d, ex, ey)
    assert (least <= s <= most) == (inside > 0.0)


def test_without_a_peak_in_the_cell_the_span_is_empty():
    half = np.sqrt(0.5)
    least, most = span_of_peaks(1.0, half, half)
    assert least > most
    assert span_of_peaks(0.0, half, half) == pytest.approx((0.0, 2.0 * half), abs=1e-8)
