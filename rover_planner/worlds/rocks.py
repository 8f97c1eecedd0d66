# SPDX-License-Identifier: Apache-2.0
"""Rocks of a generated terrain: size distribution, and shape on an elevation grid.

Size-frequency law of Golombek and Rapp (1997), Size-frequency distributions of rocks on Mars and
Earth analog sites, Journal of Geophysical Research 102(E2): rocks of diameter D [m] and larger
cover the fraction F_k(D) = k exp(-q(k) D) of the ground, q(k) = 1.79 + 0.152 / k, where k is the
fraction that all rocks cover. The two Viking sites fitted it with k of about 0.07 and 0.18. A rock
of diameter D covers pi D^2 / 4, so per square metre there are

    n(D) dD = 4 k q exp(-q D) / (pi D^2) dD

rocks of diameter D to D + dD. Rocks are half-ellipsoids whose height is half of their diameter.
"""

import numpy as np

from rover_planner.errors import PlanningError

MAX_COUNT = 500_000
"""Largest expected number of rocks."""
HEIGHT_TO_DIAMETER = 0.5
"""Height of a rock over its diameter (Golombek and Rapp 1997 find about one half)."""


def cumulative_number(k: float, diameters: np.ndarray, largest: float) -> np.ndarray:
    """Return the number of rocks per square metre at or above each diameter.

    Args:
        k: Fraction of the ground that all rocks cover.
        diameters: Diameters (n,) [m], above 0.
        largest: Diameter [m] of the largest rocks counted.

    Returns:
        Numbers (n,) [1/m^2] of rocks between each diameter and `largest`; the law's n(D)
        integrated by Simpson's rule in log D.
    """
    q = 1.79 + 0.152 / k
    steps = 256
    diameters = np.minimum(np.asarray(diameters, dtype=float), largest)
    logs = np.linspace(np.log(diameters), np.log(largest), steps + 1)
    sizes = np.exp(logs)
    # n(D) dD = n(D) D dlogD
    integrand = 4 * k * q * np.exp(-q * sizes) / (np.pi * sizes)
    weights = np.ones(steps + 1)
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    return (weights[:, None] * integrand).sum(axis=0) * (logs[1] - logs[0]) / 3


def sample_diameters(
    rng: np.random.Generator, k: float, area: float, smallest: float, largest: float
) -> np.ndarray:
    """Draw the diameters of the rocks on a piece of ground.

    Args:
        rng: Source of the random numbers.
        k: Fraction of the ground that all rocks cover.
        area: Size of the ground [m^2].
        smallest: Diameter [m] of the smallest rocks drawn.
        largest: Diameter [m] of the largest.

    Returns:
        Diameters (n,) [m]; n is Poisson distributed about the number that the law expects.

    Raises:
        PlanningError: k outside 0 to 1, or more than MAX_COUNT rocks.
    """
    if not 0 <= k < 1:
        raise PlanningError(f"rock cover is {k!r}; it is a fraction of the ground, 0 to 1")
    if k == 0:
        return np.zeros(0)
    sizes = np.geomspace(smallest, largest, 512)
    numbers = cumulative_number(k, sizes, largest)
    if numbers[0] * area > MAX_COUNT:
        raise PlanningError(
            f"rock cover is {k!r}, which are {numbers[0] * area:.2g} rocks; there may be at most "
            f"{MAX_COUNT}: lower it, or make the cells larger"
        )
    count = rng.poisson(numbers[0] * area)
    # inverse of the cumulative law; numbers increase from the largest diameter down
    drawn = np.interp(rng.random(count) * numbers[0], numbers[::-1], np.log(sizes[::-1]))
    return np.exp(drawn)


def add_rocks(
    elevation: np.ndarray,
    resolution: float,
    columns: np.ndarray,
    rows: np.ndarray,
    diameters: np.ndarray,
) -> None:
    """Put half-ellipsoids on an elevation grid, in place.

    Args:
        elevation: Heights (ny, nx) [m], without NaN.
        resolution: Cell size [m].
        columns: Centres of the rocks along x (n,) [cells, may be fractions], on the grid.
        rows: Centres of the rocks along y (n,) [cells, may be fractions], on the grid.
        diameters: Diameters (n,) [m]; a rock stands on the height at its centre.
    """
    ny, nx = elevation.shape
    ground = elevation[np.round(rows).astype(int), np.round(columns).astype(int)]
    for column, row, diameter, base in zip(columns, rows, diameters, ground, strict=True):
        half = 0.5 * diameter / resolution
        i0, i1 = max(0, int(np.ceil(column - half))), min(nx, int(column + half) + 1)
        j0, j1 = max(0, int(np.ceil(row - half))), min(ny, int(row + half) + 1)
        dx = (np.arange(i0, i1) - column) / half
        dy = (np.arange(j0, j1) - row) / half
        inside = 1 - dx[None, :] ** 2 - dy[:, None] ** 2
        top = base + HEIGHT_TO_DIAMETER * diameter * np.sqrt(np.maximum(inside, 0.0))
        patch = elevation[j0:j1, i0:i1]
        np.copyto(patch, np.maximum(patch, top), where=inside > 0)
