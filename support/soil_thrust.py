# SPDX-License-Identifier: Apache-2.0
"""Thrust of a wheel at a slip ratio; the product finds the slip ratio of a thrust."""

import numpy as np

from rover_physics.forces.soil import (
    SHEAR_MODULUS,
    contact_length,
    find_sinkage,
    mobilised_share,
    shear_strength,
)


def thrust_at_slip(soil: np.ndarray, radius: float, width: float, N: float, slip: float) -> float:
    """Return the thrust F [N] at a slip ratio, drawbar pull plus motion resistance.

    F = (A c + N tan(phi)) (1 - K / (i l) (1 - exp(-i l / K))), negative for braking. It is 0 for a
    wheel sunk to its axle. `soil` is a row of `pack_soils`.
    """
    sinkage = find_sinkage(soil, radius, width, N)
    if sinkage >= radius:
        return 0.0
    length = contact_length(radius, sinkage)
    share = mobilised_share(abs(slip) * length / soil[SHEAR_MODULUS])
    return float(np.copysign(share * shear_strength(soil, width * length, N), slip))
