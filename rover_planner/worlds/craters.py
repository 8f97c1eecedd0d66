# SPDX-License-Identifier: Apache-2.0
"""Craters of a generated terrain: size distribution, and relief with rim and ejecta.

Fresh simple craters have a depth, rim to floor, of about a fifth of their diameter. Their rim
is about 0.036 diameters above the plain (Pike 1977, Size-dependence in the shape of fresh
impact craters on the Moon). The bowl is a paraboloid; the ejecta blanket thins with the cube of
the distance (McGetchin, Settle and Head 1973, Radial thickness variation in impact crater
ejecta). The number of craters of diameter D and larger falls with D^-2, that of a surface in
equilibrium, where new craters wipe out old ones (Trask 1966, in Ranger VIII and IX; Gault 1970,
Radio Science 5).
"""

import numpy as np

from rover_planner.errors import PlanningError

DEPTH_TO_DIAMETER = 0.2
"""Depth of a fresh crater, from rim to floor, over its diameter."""
RIM_TO_DIAMETER = 0.036
"""Height of a fresh crater's rim over the plain, over its diameter."""
NUMBER_EXPONENT = 2.0
"""Craters of diameter D and larger are proportional to D to minus this power."""
MAX_COUNT = 100_000
"""Largest expected number of craters."""
EJECTA_RADII = 3.0
"""Outer radius of the ejecta blanket [crater radii]."""


def crater_profile(distance, diameter: float) -> np.ndarray:
    """Return the height of a fresh crater above the surrounding plain.

    Args:
        distance: Distances from its centre [m], any shape.
        diameter: Diameter from rim to rim [m].

    Returns:
        Heights [m] of the same shape: negative on the floor, highest on the rim, zero from
        EJECTA_RADII radii on.
    """
    r = np.asarray(distance, dtype=float) / (0.5 * diameter)
    rim = RIM_TO_DIAMETER * diameter
    depth = DEPTH_TO_DIAMETER * diameter
    bowl = rim - depth * (1 - r**2)
    outside = np.clip(r, 1.0, EJECTA_RADII) ** -3.0
    end = EJECTA_RADII**-3.0
    return np.where(r < 1, bowl, rim * (outside - end) / (1 - end))


def sample_diameters(
    rng: np.random.Generator, density: float, area: float, smallest: float, largest: float
) -> np.ndarray:
    """Draw the diameters of the craters on a piece of ground.

    Args:
        rng: Source of the random numbers.
        density: Craters of 1 m and larger per square metre [1/m^2], by the law above.
        area: Size of the ground [m^2].
        smallest: Diameter [m] of the smallest craters drawn.
        largest: Diameter [m] of the largest.

    Returns:
        Diameters (n,) [m], largest first; n is Poisson distributed.

    Raises:
        PlanningError: A negative density, or one of more than MAX_COUNT craters.
    """
    if not 0 <= density < np.inf:
        raise PlanningError(f"crater density is {density!r} 1/m^2; it must not be negative")
    most, least = smallest**-NUMBER_EXPONENT, largest**-NUMBER_EXPONENT
    expected = density * area * (most - least)
    if expected > MAX_COUNT:
        raise PlanningError(
            f"crater density is {density!r} 1/m^2, which are {expected:.2g} craters; it must be "
            f"at most {MAX_COUNT / expected * density:.2g} 1/m^2"
        )
    count = rng.poisson(expected)
    drawn = (least + rng.random(count) * (most - least)) ** (-1 / NUMBER_EXPONENT)
    return np.sort(drawn)[::-1]


def add_crater(
    elevation: np.ndarray,
    resolution: float,
    column: float,
    row: float,
    diameter: float,
    freshness: float,
) -> None:
    """Dig a crater into an elevation grid, in place.

    Args:
        elevation: Heights (ny, nx) [m].
        resolution: Cell size [m].
        column: Centre along x [cells, may be a fraction or off the grid].
        row: Centre along y [cells, may be a fraction or off the grid].
        diameter: Diameter [m].
        freshness: Scale of the relief, 1 for a fresh crater, less for a worn one.
    """
    ny, nx = elevation.shape
    extent = EJECTA_RADII * 0.5 * diameter / resolution
    i0, i1 = max(0, int(column - extent)), min(nx, int(column + extent) + 2)
    j0, j1 = max(0, int(row - extent)), min(ny, int(row + extent) + 2)
    if i0 >= i1 or j0 >= j1:
        return
    x = (np.arange(i0, i1) - column) * resolution
    y = (np.arange(j0, j1) - row) * resolution
    relief = crater_profile(np.hypot(x[None, :], y[:, None]), diameter)
    elevation[j0:j1, i0:i1] += freshness * relief
