# SPDX-License-Identifier: Apache-2.0
"""Angles in the range from -pi to pi."""

import numpy as np


def wrap(angle):
    """Wrap an angle or an array of angles [rad] into -pi to pi; angles inside stay unchanged."""
    inside = np.abs(angle) <= np.pi
    if np.all(inside):
        return angle
    return np.where(inside, angle, np.arctan2(np.sin(angle), np.cos(angle)))
