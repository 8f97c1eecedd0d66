# SPDX-License-Identifier: Apache-2.0
"""The survey of one chunk: the work of one task, in whatever process it runs."""

import time
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

import rover_physics
from rover_physics.results.record import RESULT
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import BLOCK
from rover_planner.errors import PlanningError
from rover_planner.survey.layout import Box, Index
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.store import StoreNotes, SurveyStore, is_refusal
from rover_planner.survey.tile_survey import BATCH, survey_tile

BYTES_OF_CELL = 60
"""Memory of a map cell of a chunk with all layers, as read and as the kernels read it."""
BYTES_OF_PROCESS = 450_000_000
"""Memory of a worker before its first chunk: interpreter, libraries and compiled kernels."""


@dataclass(frozen=True, eq=False)
class SurveyJob:
    """All that a worker needs to know; small, as it goes with each task."""

    request: SurveyRequest
    """The question."""
    store: Path
    """Folder of the store; all workers see it, and the map if that is a GeoTIFF."""
    version: str = rover_physics.__version__
    """Version of the model."""


def survey_chunk(job: SurveyJob, chunk: Index) -> int | OSError:
    """Survey a chunk and write it into the store.

    Returns:
        The number of its poses, or why the system refuses to write. It is not raised: Dask would
        survey the chunk again.

    Raises:
        PlanningError: The worker has another version of the model.
        RoverError, OSError: The map cannot be read, or not computed with.
    """
    if job.version != rover_physics.__version__:
        raise PlanningError(
            f"the worker has version {rover_physics.__version__}, the survey {job.version}"
        )
    numba.set_num_threads(1)  # a worker is one core
    began, store = time.perf_counter(), SurveyStore(job.store)
    try:
        layers = compute_chunk(job.request, store, chunk)
    except PlanningError as error:
        error.__cause__ = error.__context__ = None  # GDAL's errors cannot be sent to the client
        raise
    try:
        store.write(chunk, layers, time.perf_counter() - began)
    except OSError as error:
        if not is_refusal(error):
            raise
        return error
    return layers["worst_class"].size * job.request.headings


def compute_chunk(
    request: SurveyRequest, store: SurveyStore, chunk: Index
) -> dict[str, np.ndarray]:
    """Return the layers of a chunk."""
    layout, resolution = store.notes.layout, store.notes.frame.resolution
    source = store.open_map()
    cells = layout.cells_of(chunk)
    window = layout.window_of(cells)
    grids, soils = source.read(window), source.soil_names
    shape = tuple(span.stop - span.start for span in cells)
    layers = {name: np.full(shape, value) for name, value in store.notes.layers.items()}
    for tile in layout.tiles_of(chunk):
        part = layout.window_of(tile)
        below = _relative(part, window)
        ground = {name: np.ascontiguousarray(grid[below]) for name, grid in grids.items()}
        terrain = None
        if not np.isnan(ground["elevation"]).all():
            low, left = (
                (span.start - own.start * layout.step) * resolution
                for span, own in zip(part, tile, strict=True)
            )
            terrain = Terrain(
                **ground, resolution=resolution, origin=(left, low), soil_names=soils
            )
        sizes = [span.stop - span.start for span in tile]
        y, x = (np.arange(size) * (layout.step * resolution) for size in sizes)
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        here = _relative(tile, cells)
        for name, values in survey_tile(request, terrain, places).items():
            layers[name][here] = values.reshape(sizes)
    return layers


def estimate_memory(notes: StoreNotes) -> int:
    """Return the memory [bytes] that a worker needs for the largest chunk with its halo."""
    layout = notes.layout
    rows, columns = (min(layout.chunk, size) for size in layout.shape)
    sides = [
        min((side - 1) * layout.step + 1 + 2 * layout.halo + BLOCK, size)
        for side, size in zip((rows, columns), layout.map_shape, strict=True)
    ]
    kept = 2 * rows * columns * sum(value.itemsize for value in notes.layers.values())
    poses = 4 * max(BATCH, notes.headings) * RESULT.itemsize
    return BYTES_OF_PROCESS + BYTES_OF_CELL * sides[0] * sides[1] + kept + poses


def _relative(box: Box, to: Box) -> Box:
    """Return a box, whose indices count from the start of another."""
    rows, columns = (
        slice(span.start - base.start, span.stop - base.start)
        for span, base in zip(box, to, strict=True)
    )
    return rows, columns
