# SPDX-License-Identifier: Apache-2.0
"""Generates a Mars-like terrain from a seed: fractal relief, craters and rocks."""

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError
from rover_planner.worlds import craters, rocks

HURST = 0.8
"""Hurst exponent: the RMS height difference is proportional to distance^HURST.

0.5 is a random walk, 1 a surface equally rough at every scale; natural terrain lies between
(Shepard et al. 2001, The roughness of natural terrain, Journal of Geophysical Research 106(E12)).
"""

MAX_SIZE = 1e6
"""Largest width and height [m]."""
MAX_ROUGHNESS = 100.0
"""Largest RMS height difference of points 1 m apart [m]."""


def make_mars_terrain(
    seed: int,
    size: float = 24.0,
    resolution: float = 0.05,
    *,
    roughness: float = 0.04,
    crater_density: float = 0.02,
    rock_cover: float = 0.03,
) -> Terrain:
    """Generate a Mars-like terrain; the same arguments give the same terrain.

    Craters have diameters from 1 m to a third of the map, rocks from two cells to 1.5 m.

    Args:
        seed: Seed of all random numbers.
        size: Width and height [m].
        resolution: Cell size [m].
        roughness: RMS height difference of the relief between points 1 m apart [m].
        crater_density: Craters of 1 m and larger per square metre [1/m^2], see craters.py.
        rock_cover: Fraction of the ground that rocks cover, the k of Golombek and Rapp's law.

    Returns:
        A terrain centred on (0, 0), with mean height zero and without NaN.

    Raises:
        PlanningError: An argument out of range.
    """
    cells = _count_cells(size, resolution)
    if seed < 0:
        raise PlanningError(f"seed is {seed!r}; it must be a whole number of at least 0")
    # separate random streams, so that the number of rocks does not change the relief
    relief_rng, crater_rng, rock_rng = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)
    )
    elevation = make_relief(relief_rng, cells, resolution, roughness)
    _dig_craters(crater_rng, elevation, resolution, crater_density)
    _strew_rocks(rock_rng, elevation, resolution, rock_cover)
    elevation -= elevation.mean()
    corner = -0.5 * (cells - 1) * resolution
    return Terrain(elevation, resolution, (corner, corner))


def make_relief(
    rng: np.random.Generator, cells: int, resolution: float, roughness: float
) -> np.ndarray:
    """Generate fractal relief by spectral synthesis.

    Source: Saupe 1988, in The Science of Fractal Images.

    White noise is filtered to a power spectrum proportional to wave number^-(2 HURST + 2). Because
    the result is periodic, it is computed on a grid twice as large and cropped. Then it is scaled
    to the roughness.

    Args:
        rng: Source of the random numbers.
        cells: Number of cells along x and y.
        resolution: Cell size [m].
        roughness: RMS height difference between points 1 m apart [m].

    Returns:
        Heights (cells, cells) [m].

    Raises:
        PlanningError: Roughness out of range, or a size of at most 0.5 m.
    """
    if not 0 <= roughness <= MAX_ROUGHNESS:
        raise PlanningError(
            f"roughness is {roughness!r} m; it must not be negative, and at most {MAX_ROUGHNESS} m"
        )
    n, lag = 2 * cells, max(1, round(1.0 / resolution))
    if n <= lag:
        size = cells * resolution
        raise PlanningError(
            f"size is {size:g} x {size:g} m; it must be more than 0.5 m, "
            "because the roughness is that of points 1 m apart"
        )
    ky = np.fft.fftfreq(n)[:, None]
    kx = np.fft.rfftfreq(n)[None, :]
    wave_number = np.hypot(ky, kx)
    wave_number[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.standard_normal((n, n))) * wave_number ** -(HURST + 1)
    surface = np.fft.irfft2(spectrum, s=(n, n))
    difference = np.sqrt(np.mean((np.roll(surface, lag, axis=1) - surface) ** 2))
    return surface[:cells, :cells] * (roughness * (lag * resolution) ** HURST / difference)


def _dig_craters(rng, elevation, resolution, density) -> None:
    """Add craters in and around the map, the largest first, with random freshness."""
    cells = len(elevation)
    largest = max(1.5, cells * resolution / 3)
    margin = 0.5 * craters.EJECTA_RADII * largest / resolution
    area = (cells + 2 * margin) ** 2 * resolution**2
    for diameter in craters.sample_diameters(rng, density, area, 1.0, largest):
        column, row = rng.uniform(-margin, cells + margin, 2)
        freshness = rng.uniform(0.2, 1.0)
        craters.add_crater(elevation, resolution, column, row, diameter, freshness)


def _strew_rocks(rng, elevation, resolution, cover) -> None:
    """Add rocks at random positions of the map."""
    cells = len(elevation)
    span = 2 * resolution, max(1.5, 3 * resolution)
    diameters = rocks.sample_diameters(rng, cover, cells**2 * resolution**2, *span)
    columns, rows = rng.uniform(0, cells - 1, (2, len(diameters)))
    rocks.add_rocks(elevation, resolution, columns, rows, diameters)


def _count_cells(size: float, resolution: float) -> int:
    """Return the number of cells along a side of a map of `size` [m] at `resolution` [m]."""
    if not 0 < resolution < np.inf:
        raise PlanningError(f"resolution is {resolution!r}; it must be above 0 m")
    if not 2 * resolution <= size <= MAX_SIZE:
        raise PlanningError(
            f"size is {size} x {size} m; it must be at least two cells wide, and at most "
            f"{MAX_SIZE:g} m"
        )
    if (size / resolution) ** 2 > MAX_CELLS:
        raise PlanningError(f"{size} x {size} m at {resolution} m are more than {MAX_CELLS} cells")
    return round(size / resolution)
