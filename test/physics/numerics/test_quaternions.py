# SPDX-License-Identifier: Apache-2.0
"""Quaternions: of length 1, in the order that the name says, and the turns that scipy makes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rover_physics.numerics.quaternions import (
    forward_from_xyzw,
    matrix_from_xyzw,
    rpy_from_xyzw,
    wxyz_about_y,
    wxyz_from_rpy,
    xyzw_from_rpy,
    xyzw_from_wxyz,
    xyzw_from_yaw,
)

ANGLES = st.floats(-math.pi, math.pi)
PITCHES = st.floats(-1.5, 1.5)
"""Pitches [rad] at which roll and yaw are two angles, not one."""
ROUNDING = 4e-16


@given(ANGLES, ANGLES, ANGLES)
def test_a_quaternion_of_angles_has_length_1_and_turns_as_that_of_scipy(roll, pitch, yaw):
    xyzw = xyzw_from_rpy(roll, pitch, yaw)
    assert np.linalg.norm(xyzw) == pytest.approx(1.0, abs=ROUNDING)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(xyzw).as_matrix(), expected, atol=2e-15)
    np.testing.assert_allclose(matrix_from_xyzw(xyzw), expected, atol=2e-15)
    np.testing.assert_allclose(forward_from_xyzw(xyzw), expected[:2, 0], atol=2e-15)


@given(ANGLES, PITCHES, ANGLES, st.floats(0.9, 1.1))
def test_angles_come_back_from_a_quaternion_of_any_length(roll, pitch, yaw, length):
    xyzw = xyzw_from_rpy(roll, pitch, yaw)
    longer = length * xyzw
    for back in (rpy_from_xyzw(xyzw), rpy_from_xyzw(longer, squared_norm=float(longer @ longer))):
        np.testing.assert_allclose(np.sin(back), np.sin([roll, pitch, yaw]), atol=1e-12)
        np.testing.assert_allclose(np.cos(back), np.cos([roll, pitch, yaw]), atol=1e-12)


@given(ANGLES)
def test_a_turn_about_y_is_a_pitch_and_a_yaw_a_turn_about_z(angle):
    pitched = xyzw_from_rpy(0.0, angle, 0.0)
    np.testing.assert_allclose(wxyz_about_y(angle), wxyz_from_rpy(0.0, angle, 0.0), atol=ROUNDING)
    np.testing.assert_allclose(xyzw_from_wxyz(wxyz_about_y(angle)), pitched, atol=ROUNDING)
    np.testing.assert_allclose(xyzw_from_yaw(angle), xyzw_from_rpy(0.0, 0.0, angle), atol=ROUNDING)
