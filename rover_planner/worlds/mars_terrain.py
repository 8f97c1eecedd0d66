# SPDX-License-Identifier: Apache-2.0
"""Generates a Mars-like terrain from a seed: fractal relief, craters and rocks."""

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError
from rover_planner.worlds import craters, rocks

HURST = 0.8
"""Default Hurst exponent: the RMS height difference is proportional to distance^HURST.

0.5 is a random walk, 1 a surface equally rough at every scale; natural terrain lies between
(Shepard et al. 2001, The roughness of natural terrain, Journal of Geophysical Research 106(E12)).
"""

MAX_SIZE = 1e6
"""Largest width and height [m]."""
MAX_ROUGHNESS = 100.0
"""Largest RMS height difference of points 1 m apart [m]."""


def make_mars_terrain(
    seed: int,
    size: tuple[float, float] | float = 24.0,
    resolution: float = 0.05,
    *,
    hurst: float = HURST,
    roughness: float = 0.04,
    crater_density: float = 0.02,
    crater_diameters: tuple[float, float] | None = None,
    rock_cover: float = 0.03,
    rock_diameters: tuple[float, float] | None = None,
) -> Terrain:
    """Generate a Mars-like terrain; the same arguments give the same terrain.

    Args:
        seed: Seed of all random numbers.
        size: Extent along x and y [m], or one number for both.
        resolution: Cell size [m].
        hurst: Exponent of the fractal relief, see HURST.
        roughness: RMS height difference of the relief between points 1 m apart [m].
        crater_density: Craters of 1 m and larger per square metre [1/m^2], see craters.py.
        crater_diameters: Smallest and largest crater [m]; by default 1 m to a third of the map.
        rock_cover: Fraction of the ground that rocks cover, the k of Golombek and Rapp's law.
        rock_diameters: Smallest and largest rock [m]; by default two cells to 1.5 m.

    Returns:
        A terrain centred on (0, 0), with mean height zero and without NaN.

    Raises:
        PlanningError: An argument out of range.
    """
    nx, ny = _count_cells(size, resolution)
    width, height = nx * resolution, ny * resolution
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise PlanningError(f"seed is {seed!r}; it must be a whole number of at least 0")
    # separate random streams, so that the number of rocks does not change the relief
    relief_rng, crater_rng, rock_rng = (
        np.random.default_rng(s) for s in np.random.SeedSequence(int(seed)).spawn(3)
    )
    elevation = make_relief(relief_rng, (ny, nx), resolution, hurst, roughness)
    span = crater_diameters or (1.0, max(1.5, min(width, height) / 3))
    _dig_craters(crater_rng, elevation, resolution, crater_density, span)
    span = rock_diameters or (2 * resolution, max(1.5, 3 * resolution))
    _strew_rocks(rock_rng, elevation, resolution, rock_cover, span)
    elevation -= elevation.mean()
    origin = (-0.5 * (nx - 1) * resolution, -0.5 * (ny - 1) * resolution)
    return Terrain(elevation, float(resolution), origin)


def make_relief(
    rng: np.random.Generator,
    shape: tuple[int, int],
    resolution: float,
    hurst: float,
    roughness: float,
) -> np.ndarray:
    """Generate fractal relief by spectral synthesis.

    Source: Saupe 1988, in The Science of Fractal Images.

    White noise is filtered to a power spectrum proportional to wave number^-(2 hurst + 2). Because
    the result is periodic, it is computed on a grid twice as large and cropped. Then it is scaled
    to the roughness.

    Args:
        rng: Source of the random numbers.
        shape: ny, nx.
        resolution: Cell size [m].
        hurst: Exponent of the relief, above 0 and below 1.
        roughness: RMS height difference between points 1 m apart [m].

    Returns:
        Heights (ny, nx) [m].

    Raises:
        PlanningError: hurst or roughness out of range, or a size of at most 0.5 m.
    """
    if not 0 < hurst < 1:
        raise PlanningError(f"hurst is {hurst!r}; it must be above 0 and below 1")
    if not 0 <= roughness <= MAX_ROUGHNESS:
        raise PlanningError(
            f"roughness is {roughness!r} m; it must not be negative, and at most {MAX_ROUGHNESS} m"
        )
    ny, nx = shape
    n, lag = 2 * max(ny, nx), max(1, round(1.0 / resolution))
    if n <= lag:
        raise PlanningError(
            f"size is {nx * resolution:g} x {ny * resolution:g} m; it must be more than 0.5 m, "
            "because the roughness is that of points 1 m apart"
        )
    ky = np.fft.fftfreq(n)[:, None]
    kx = np.fft.rfftfreq(n)[None, :]
    wave_number = np.hypot(ky, kx)
    wave_number[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.standard_normal((n, n))) * wave_number ** -(hurst + 1)
    surface = np.fft.irfft2(spectrum, s=(n, n))
    difference = np.sqrt(np.mean((np.roll(surface, lag, axis=1) - surface) ** 2))
    return surface[:ny, :nx] * (roughness * (lag * resolution) ** hurst / difference)


def _dig_craters(rng, elevation, resolution, density, span) -> None:
    """Add craters in and around the map, the largest first, with random freshness."""
    ny, nx = elevation.shape
    margin = 0.5 * craters.EJECTA_RADII * span[1] / resolution
    area = (nx + 2 * margin) * (ny + 2 * margin) * resolution**2
    for diameter in craters.sample_diameters(rng, density, area, *span):
        column, row = rng.uniform(-margin, nx + margin), rng.uniform(-margin, ny + margin)
        freshness = rng.uniform(0.2, 1.0)
        craters.add_crater(elevation, resolution, column, row, diameter, freshness)


def _strew_rocks(rng, elevation, resolution, cover, span) -> None:
    """Add rocks at random positions of the map."""
    ny, nx = elevation.shape
    diameters = rocks.sample_diameters(rng, cover, nx * ny * resolution**2, *span)
    columns = rng.uniform(0, nx - 1, len(diameters))
    rows = rng.uniform(0, ny - 1, len(diameters))
    rocks.add_rocks(elevation, resolution, columns, rows, diameters)


def _count_cells(size, resolution) -> tuple[int, int]:
    """Return nx and ny of a map of `size` [m] at `resolution` [m]."""
    try:
        width, height = (float(v) for v in np.broadcast_to(np.asarray(size, dtype=float), 2))
        resolution = float(resolution)
    except (TypeError, ValueError):
        raise PlanningError(
            f"size is {size!r} at resolution {resolution!r}; they are numbers of metres"
        ) from None
    if not 0 < resolution < np.inf:
        raise PlanningError(f"resolution is {resolution!r}; it must be above 0 m")
    if not (2 * resolution <= width <= MAX_SIZE and 2 * resolution <= height <= MAX_SIZE):
        raise PlanningError(
            f"size is {width} x {height} m; it must be at least two cells wide, and at most "
            f"{MAX_SIZE:g} m"
        )
    if width / resolution * height / resolution > MAX_CELLS:
        raise PlanningError(
            f"{width} x {height} m at {resolution} m are more than {MAX_CELLS} cells"
        )
    return round(width / resolution), round(height / resolution)
