# SPDX-License-Identifier: Apache-2.0
"""Mars-like terrain: fractal relief with craters and rocks whose sizes follow measured laws.

Craters: fresh simple ones have a depth, rim to floor, of about a fifth of their diameter. Their
rim is about 0.036 diameters above the plain (Pike 1977, Size-dependence in the shape of fresh
impact craters on the Moon). The bowl is a paraboloid; the ejecta blanket thins with the cube of
the distance (McGetchin, Settle and Head 1973, Radial thickness variation in impact crater
ejecta). The number of craters of diameter D and larger falls with D^-2, that of a surface in
equilibrium, where new craters wipe out old ones (Trask 1966, in Ranger VIII and IX; Gault 1970,
Radio Science 5).

Rocks: the size-frequency law of Golombek and Rapp (1997), Size-frequency distributions of rocks
on Mars and Earth analog sites, Journal of Geophysical Research 102(E2): rocks of diameter D [m]
and larger cover the fraction F_k(D) = k exp(-q(k) D) of the ground, q(k) = 1.79 + 0.152 / k, where
k is the fraction that all rocks cover. The two Viking sites fitted it with k of about 0.07 and
0.18. A rock of diameter D covers pi D^2 / 4, so per square metre there are

    n(D) dD = 4 k q exp(-q D) / (pi D^2) dD

rocks of diameter D to D + dD. Rocks are half-ellipsoids whose height is half of their diameter.
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import exp1

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError

HURST = 0.8
"""Hurst exponent: the RMS height difference is proportional to distance^HURST.

0.5 is a random walk, 1 a surface equally rough at every scale; natural terrain lies between
(Shepard et al. 2001, The roughness of natural terrain, Journal of Geophysical Research 106(E12)).
"""
DEPTH_TO_DIAMETER = 0.2
"""Depth of a fresh crater, from rim to floor, over its diameter."""
RIM_TO_DIAMETER = 0.036
"""Height of a fresh crater's rim over the plain, over its diameter."""
EJECTA_RADII = 3.0
"""Outer radius of the ejecta blanket [crater radii]."""
HEIGHT_TO_DIAMETER = 0.5
"""Height of a rock over its diameter (Golombek and Rapp 1997 find about one half)."""
MAX_SIZE = 1e6
"""Largest width and height [m]."""
MAX_ROUGHNESS = 100.0
"""Largest RMS height difference of points 1 m apart [m]."""
MAX_CRATERS, MAX_ROCKS = 100_000, 500_000
"""Largest expected numbers."""


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
        crater_density: Craters of 1 m and larger per square metre [1/m^2].
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
) -> Floats:
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


def _dig_craters(
    rng: np.random.Generator, elevation: Floats, resolution: float, density: float
) -> None:
    """Add craters in and around the map, the largest first, with random freshness."""
    cells = len(elevation)
    largest = max(1.5, cells * resolution / 3)
    margin = 0.5 * EJECTA_RADII * largest / resolution
    area = (cells + 2 * margin) ** 2 * resolution**2
    for diameter in np.sort(draw_craters(rng, density, area, largest))[::-1]:
        column, row = rng.uniform(-margin, cells + margin, 2)
        freshness = rng.uniform(0.2, 1.0)
        reach = EJECTA_RADII * 0.5 * diameter
        patch, away = _cut(elevation, column, row, reach / resolution)
        patch += freshness * crater_profile(reach * away, diameter)


def draw_craters(rng: np.random.Generator, density: float, area: float, largest: float) -> Floats:
    """Draw the diameters (n,) [m] of craters from 1 m to `largest` [m] on an area [m^2].

    Raises:
        PlanningError: A negative density [1/m^2], or one of more than MAX_CRATERS.
    """
    if not 0 <= density < np.inf:
        raise PlanningError(f"crater density is {density!r} 1/m^2; it must not be negative")
    sizes = np.geomspace(1.0, largest, 512)
    numbers = density * area * (sizes**-2.0 - largest**-2.0)
    if numbers[0] > MAX_CRATERS:
        raise PlanningError(
            f"crater density is {density!r} 1/m^2, which are {numbers[0]:.2g} craters; it must be "
            f"at most {MAX_CRATERS / numbers[0] * density:.2g} 1/m^2"
        )
    return _draw_sizes(rng, sizes, numbers)


def crater_profile(distance: ArrayLike, diameter: float) -> Floats:
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


def _strew_rocks(
    rng: np.random.Generator, elevation: Floats, resolution: float, cover: float
) -> None:
    """Add rocks at random positions of the map."""
    cells = len(elevation)
    span = 2 * resolution, max(1.5, 3 * resolution)
    diameters = draw_rocks(rng, cover, cells**2 * resolution**2, *span)
    columns, rows = rng.uniform(0, cells - 1, (2, len(diameters)))
    add_rocks(elevation, resolution, columns, rows, diameters)


def draw_rocks(
    rng: np.random.Generator, cover: float, area: float, smallest: float, largest: float
) -> Floats:
    """Draw the diameters (n,) [m] of rocks between two diameters [m] on an area [m^2].

    Raises:
        PlanningError: A cover outside 0 to 1, or one of more than MAX_ROCKS.
    """
    if not 0 <= cover < 1:
        raise PlanningError(f"rock cover is {cover!r}; it is a fraction of the ground, 0 to 1")
    if cover == 0:
        return np.zeros(0)
    sizes = np.geomspace(smallest, largest, 512)
    numbers = area * count_rocks(cover, sizes, largest)
    if numbers[0] > MAX_ROCKS:
        raise PlanningError(
            f"rock cover is {cover!r}, which are {numbers[0]:.2g} rocks; there may be at most "
            f"{MAX_ROCKS}: lower it, or make the cells larger"
        )
    return _draw_sizes(rng, sizes, numbers)


def count_rocks(cover: float, diameters: ArrayLike, largest: float) -> Floats:
    """Return the numbers of rocks per square metre from each diameter to the largest.

    Args:
        cover: Fraction of the ground that all rocks cover.
        diameters: Diameters (n,) [m], above 0.
        largest: Diameter [m] of the largest rocks counted.

    Returns:
        Numbers (n,) [1/m^2]: the integral of the law's n(D).
    """
    q = 1.79 + 0.152 / cover
    small, large = (
        np.exp(-q * d) / d - q * exp1(q * d) for d in (np.asarray(diameters), np.array(largest))
    )
    return np.maximum(4 * cover * q / np.pi * (small - large), 0.0)  # rounded where there are none


def add_rocks(
    elevation: Floats, resolution: float, columns: Floats, rows: Floats, diameters: Floats
) -> None:
    """Put half-ellipsoids on an elevation grid, in place.

    Args:
        elevation: Heights (ny, nx) [m], without NaN.
        resolution: Cell size [m].
        columns: Centres of the rocks along x (n,) [cells, may be fractions], on the grid.
        rows: Centres of the rocks along y (n,) [cells, may be fractions], on the grid.
        diameters: Diameters (n,) [m]; a rock stands on the height at its centre.
    """
    ground = elevation[np.round(rows).astype(int), np.round(columns).astype(int)]
    for column, row, diameter, base in zip(columns, rows, diameters, ground, strict=True):
        patch, away = _cut(elevation, column, row, 0.5 * diameter / resolution)
        inside = 1 - away**2
        top = base + HEIGHT_TO_DIAMETER * diameter * np.sqrt(np.maximum(inside, 0.0))
        np.copyto(patch, np.maximum(patch, top), where=inside > 0)


def _draw_sizes(rng: np.random.Generator, sizes: Floats, numbers: Floats) -> Floats:
    """Draw sizes by the expected numbers (n,) of things of each of the sizes (n,) and larger."""
    count = rng.poisson(numbers[0])
    drawn = np.interp(rng.random(count) * numbers[0], numbers[::-1], np.log(sizes[::-1]))
    return np.exp(drawn)


def _cut(elevation: Floats, column: float, row: float, half: float) -> tuple[Floats, Floats]:
    """Return the cells of a grid around a place, and their distances from it over half a width.

    All are in cells; the place may be off the grid.
    """
    (low, high), (left, right) = (
        (max(0, math.ceil(at - half)), max(0, math.floor(at + half) + 1)) for at in (row, column)
    )
    patch = elevation[low:high, left:right]
    y, x = np.ogrid[low : low + patch.shape[0], left : left + patch.shape[1]]
    return patch, np.hypot(x - column, y - row) / half


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
