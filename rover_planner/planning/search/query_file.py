# SPDX-License-Identifier: Apache-2.0
"""Files that hold a query for a path with its map, so that it can be asked again elsewhere."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.files.npz_file import open_npz
from rover_physics.files.validation import errors_of, read_as
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict
from rover_physics.terrain.grid import load_terrain, save_terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.query import LatticeSettings, SearchQuery
from rover_planner.planning.search.site import Site

_ENTRY, _MOST = "way_question", 1_000_000


@dataclass(frozen=True)
class _Content:
    """Content of the entry: a question for a path and the settings of its search."""

    rover: dict[str, Any]
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    options: PathQueryOptions
    settings: LatticeSettings


def write_query(path: Path, question: SearchQuery, settings: LatticeSettings) -> None:
    """Write a question to a terrain file (.npz) with one more entry; an old file is replaced.

    Raises:
        TerrainError: The file cannot be written.
    """
    site = question.site
    text = json.dumps(
        {
            "rover": rover_to_dict(site.rover),
            "start": np.asarray(question.start).tolist(),
            "goal": np.asarray(question.goal).tolist(),
            "options": asdict(site.options),
            "settings": asdict(settings),
        }
    )
    save_terrain(path, site.terrain, **{_ENTRY: text})


def read_query(path: Path, max_cells: int = MAX_CELLS) -> tuple[SearchQuery, LatticeSettings]:
    """Read a question that `write_query` has written.

    Args:
        path: The file.
        max_cells: Largest terrain [cells].

    Raises:
        TerrainError: The terrain in the file is none, or too large.
        PlanningError: The file holds no question.
        RoverError: Something in the question is not what it should be.
    """
    terrain = load_terrain(path, max_cells)
    try:
        with errors_of(path), open_npz(path) as file:
            content = json.loads(str(file.read(_ENTRY, most=_MOST)))
    except (RoverFileError, json.JSONDecodeError, RecursionError) as error:
        raise PlanningError(f"{path} holds no question for a path: {error}") from None
    with errors_of(path):
        asked: _Content = read_as(_Content, content, "a question for a path")
    rover = rover_from_dict(asked.rover, str(path))
    question = SearchQuery(Site(rover, terrain, asked.options), asked.start, asked.goal)
    return question, asked.settings
