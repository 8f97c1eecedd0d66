# SPDX-License-Identifier: Apache-2.0
"""A rover on a map, a query for a path there, how it is searched, and files that hold both."""

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import RoverFileError, TerrainError
from rover_physics.files.npz_file import open_npz
from rover_physics.files.validation import errors_of, read_as
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain, cut_around, load_terrain, save_terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError
from rover_planner.maps.unobserved_ground import ALLOW, REFUSE, UNOBSERVED_CODE, ObservedGround
from rover_planner.planning.marked_places import MARKED_CODE, NONE_MARKED, MarkedPlaces
from rover_planner.planning.path_query import Candidate, PathQueryOptions, assume
from rover_planner.planning.search.nodes import HEADINGS, Nodes, nodes_within

MAX_NODES = 1_500_000
"""Largest number of nodes of a window; each takes 90 bytes."""
_ENTRY, _MOST = "way_question", 1_000_000


@dataclass(frozen=True, eq=False)
class Site:
    """A rover on a map; options without lengths get those of the rover."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions = field(default_factory=PathQueryOptions)
    """Options of candidates and of the judgement of paths."""
    seen: ObservedGround | None = None
    """The seen part of the map; None if it is not known."""
    blind_ground: str = ALLOW
    """What of the ground under the belly that was never seen is refused: a value of the parameter
    blind_ground."""
    marked: MarkedPlaces = NONE_MARKED
    """Places that are impassable."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", self.options.fit(self.rover))

    @property
    def assumed_rover(self) -> Rover:
        """The rover with friction, torque and payload of the options in place of its own."""
        return assume(self.rover, self.options.model).change(self.rover)

    @property
    def checked_ground(self) -> ObservedGround | None:
        """The seen part of the map if ground that was never seen may be refused; else None."""
        return None if self.blind_ground == ALLOW else self.seen

    def explain_unseen(self, detail: str = "") -> str:
        """Return why ground that was never seen is refused, in words, with a detail."""
        rule = f"(blind_ground is {self.blind_ground})"
        return f"ground under the belly that was never seen{detail} {rule}"

    def refuse_ground(self, path: Candidate) -> Candidate:
        """Return a path as the model judged it, refused where its ground is unseen or marked."""
        if not path.verdict.traversable:
            return path
        if self.checked_ground is not None:
            share = self.checked_ground.share(self.rover, path.poses)
            first, counted = share.first_refused(self.blind_ground), share.unobserved_share
            if first >= 0:
                counted -= 0.0 if self.blind_ground == REFUSE else share.footprint_share
                detail = f": {100.0 * counted:.1f} % of that along the path"
                return path.refuse_at(first, UNOBSERVED_CODE, self.explain_unseen(detail))
        entered = self.marked.find(path.poses)
        if entered is not None:
            return path.refuse_at(entered[0], MARKED_CODE, entered[1].describe())
        return path


@dataclass(frozen=True, eq=False)
class SearchQuery:
    """A query for a path between two poses."""

    site: Site
    """Rover, map and options of the judgement of paths."""
    start: ArrayLike
    """(3,) x, y [m] and yaw [rad] of the body origin, map frame."""
    goal: ArrayLike
    """(3,) as `start`."""
    tolerance: float = 0.0
    """Largest distance from the goal's position [m] at which the path may end if the rover cannot
    stand at the goal; the heading stays."""


@dataclass(frozen=True)
class LatticeSettings:
    """Settings of a search for a path."""

    budget: float = 2.0
    """Time for the search [s]."""
    cell: float | None = None
    """Distance of neighbouring nodes [m]; None: a quarter of the wheelbase."""
    frontier: bool = False
    """True if a path may end at the frontier of the known ground, as near as possible to a goal
    beyond it."""
    ends_at_first: bool = False
    """True if the first path is the answer; else better ones are searched for the whole budget."""
    chance_weight: float = 0.0
    """Cost of a path that fails for sure [m of level ground]; 0 does not weigh chances."""

    def __post_init__(self) -> None:
        for name in ("budget", "cell"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise PlanningError(f"{name} is {value}; it must be a finite number above 0")
        if not (math.isfinite(self.chance_weight) and self.chance_weight >= 0.0):
            raise PlanningError(
                f"chance_weight is {self.chance_weight}; it must be a finite number of at least 0"
            )


def choose_window(query: SearchQuery, cell: float) -> tuple[Nodes, bool]:
    """Return the nodes to search, and whether they are fewer than those of the map.

    A window that must be limited is a square around start and goal.
    """
    xmin, xmax, ymin, ymax = query.site.terrain.bounds
    nodes = nodes_within(cell, (xmin, ymin), (xmax, ymax))
    if nodes.count <= MAX_NODES:
        return nodes, False
    half = 0.5 * cell * (math.isqrt(MAX_NODES // HEADINGS) - 1)
    centre = 0.5 * (np.asarray(query.start)[:2] + np.asarray(query.goal)[:2])
    low = np.maximum(centre - half, (xmin, ymin))
    high = np.minimum(centre + half, (xmax, ymax))
    return nodes_within(cell, (low[0], low[1]), (high[0], high[1])), True


def cut_out(site: Site, nodes: Nodes) -> Terrain:
    """Return the part of the map that the rover at the nodes may touch.

    The map itself comes back where no height in the part is known.
    """
    wheel, terrain = site.rover.wheel, site.terrain
    margin = swing_radius(site.rover) + 2.0 * wheel.radius + terrain.resolution
    ends = nodes.cell * np.array([nodes.first, np.add(nodes.first, nodes.shape[::-1]) - 1])
    try:
        return cut_around(terrain, ends, margin)
    except TerrainError:
        return terrain


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
