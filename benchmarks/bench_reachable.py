"""Measures the search for what can be reached: time and memory on a made map of 10^7 cells."""

import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.measure import Figure
from rover_planner.survey.layers import bits_type
from rover_planner.survey.reach.moves import find_moves
from rover_planner.survey.reach.reachable import HeadingGrid, search_area

SIDE = 3200
"""Side of the map [cells]."""
HEADINGS = 8
CHUNK = 192
"""Side of a chunk of the survey [cells]."""
BLUR = 4.0
"""Size of the blots that cannot be passed [cells]."""
OPEN = 0.9
"""Height of the blots below which a heading is passable, in standard deviations."""


def measure() -> list[Figure]:
    """Search a map on which three quarters of all headings are passable."""
    bits = make_bits(SIDE)
    moves, middle = find_moves(HEADINGS, 0.05), SIDE // 2
    column = int(np.flatnonzero(bits[middle] == bits.dtype.type(2**HEADINGS - 1))[0])
    distance = np.full(bits.shape, np.inf, np.float32)
    warm = HeadingGrid(bits[:64, :64], bits[:64, :64], moves, 32)
    with tempfile.TemporaryDirectory() as folder:
        search_area(warm, (32, 32), np.full((64, 64), np.inf, np.float32), Path(folder))
    grid = HeadingGrid(bits, bits, moves, CHUNK)
    before, began = _peak_memory(), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        found = search_area(grid, (middle, column), distance, Path(folder))
    told = (
        ("cells", bits.size, ""),
        ("cells of the area", found.cells, ""),
        ("CPU time", time.process_time() - began, "s"),
        ("memory above that of the map", (_peak_memory() - before) / 1e6, "MB"),
    )
    return [Figure("reachable", name, value, unit, repeats=1) for name, value, unit in told]


def make_bits(side: int) -> np.ndarray:
    """Return passable headings (side, side), around blots that differ a little by heading."""
    rng, kind = np.random.default_rng(1), bits_type(HEADINGS)
    blots = ndimage.gaussian_filter(rng.standard_normal((side, side), np.float32), BLUR)
    blots /= blots.std()
    bits = np.zeros((side, side), kind)
    for k in range(HEADINGS):
        is_open = blots + 0.5 * np.roll(blots, (3 * k, 5 * k), (0, 1)) < OPEN
        bits |= np.where(is_open, kind.type(1 << k), kind.type(0))
    return bits


def _peak_memory() -> int:
    """Return the largest memory that this process has had [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
