# SPDX-License-Identifier: Apache-2.0
"""A survey from question to store: opens the map, creates the store or goes on with it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.bounds.path import check_bounds, is_uncertain
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES
from rover_planner.errors import PlanningError
from rover_planner.survey.chunk_survey import SurveyJob
from rover_planner.survey.dask_cluster import ClusterSettings, check_machine
from rover_planner.survey.layers import NOT_SURVEYED
from rover_planner.survey.layout import Index, SurveyLayout, choose_chunk, find_halo
from rover_planner.survey.map_source import BAND, GeoTiffMap, MapFrame, is_geotiff
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.store import StoreNotes, SurveyStore, create_store


@dataclass(frozen=True)
class PreparedSurvey:
    """A survey whose store is there."""

    job: SurveyJob
    """The work."""
    store: SurveyStore
    """The store."""
    chunks: list[Index]
    """The chunks that are not finished."""

    @property
    def finished(self) -> int:
        """Number of chunks that were finished before."""
        rows, columns = self.store.notes.layout.chunks
        return rows * columns - len(self.chunks)


def prepare_survey(
    request: SurveyRequest,
    map_name: str,
    out: Path,
    chunk: int | None = None,
    max_cells: int = MAX_CELLS,
    max_gap: float = 0.0,
    settings: ClusterSettings | None = None,
) -> PreparedSurvey:
    """Open the map and create the store of a survey, or go on with a store of the same survey.

    Args:
        request: What is asked.
        map_name: Preset, terrain file (.npz) or GeoTIFF.
        out: Folder of the store.
        chunk: Side of a chunk [surveyed cells], rounded up to whole tiles (default: some seconds
            of work).
        max_cells: Largest terrain file [cells].
        max_gap: Widest unknown region of a terrain file that is interpolated [m].
        settings: The cluster, whose memory is checked before a store is created.

    Raises:
        PlanningError: A map or a store that cannot be used.
        TerrainError: A terrain file that cannot be read.
        ModelError: The policy has no bounds on a map with uncertain heights, or too many soils.
    """
    terrain: Terrain | None = None
    if is_geotiff(map_name):
        if max_gap != 0.0:
            raise PlanningError(
                f"max_gap is {max_gap:g}; it must be 0 for a GeoTIFF (gdal_fillnodata.py fills it)"
            )
        source = GeoTiffMap(Path(map_name).absolute())
        frame, map_file, content = source.frame, str(source.path), source.hash_content()
    else:
        terrain = load_terrain(map_name, max_cells).fill_gaps(max_gap)
        if is_uncertain(terrain, request.sigmas):
            check_bounds(terrain, request.options)
        frame = MapFrame(terrain.elevation.shape, terrain.resolution, terrain.origin, "")
        map_file, content = "", terrain.fingerprint
    notes = _make_notes(request, frame, map_file, content, chunk)
    if not out.exists():
        if settings is not None:
            check_machine(notes, settings)
        create_store(out, notes, terrain)
    store = SurveyStore(out)
    store.check(notes.description, None if chunk is None else notes.layout.chunk)
    finished = store.find_finished()
    left = [one for one in np.ndindex(store.notes.layout.chunks) if one not in finished]
    if left and map_file != store.notes.map_file:  # the map is read from where it was
        store.check_map()
    return PreparedSurvey(SurveyJob(request, out.absolute()), store, left)


def summarise(store: SurveyStore) -> dict[str, Any]:
    """Return the number of surveyed cells and their shares by best and worst class.

    Where the file of a layer is lost, its shares are those of the cells that it has.
    """
    counts = {name: np.zeros(256, np.int64) for name in ("best_class", "worst_class")}
    for name, count in counts.items():
        layer = store.layer(name)
        for first in range(0, layer.shape[0], BAND):
            count += np.bincount(layer[first : first + BAND].ravel(), minlength=256)
    cells = int(counts["best_class"].sum())
    surveyed = cells - int(counts["best_class"][NOT_SURVEYED])
    shares = {
        name: {
            which: round(int(count[number]) / max(cells - int(count[NOT_SURVEYED]), 1), 6)
            for number, which in enumerate(TRAVERSABILITY_CLASSES)
        }
        for name, count in counts.items()
    }
    return {"cells": cells, "surveyed": surveyed, **shares}


def _make_notes(
    request: SurveyRequest, frame: MapFrame, map_file: str, content: str, chunk: int | None
) -> StoreNotes:
    """Return the notes of a new store."""
    if chunk is not None and chunk < 1:
        raise PlanningError(f"chunk is {chunk}; it must be 1 or more surveyed cells")
    side = choose_chunk(frame.shape, request.step, request.headings, chunk)
    halo = find_halo(request.rover, frame.resolution)
    layout = SurveyLayout(frame.shape, request.step, side, halo)
    return StoreNotes(request.describe(content), layout, frame, map_file)
