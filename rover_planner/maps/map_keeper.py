# SPDX-License-Identifier: Apache-2.0
"""Keeps the map of a server: what a loaded map, local maps and the standing rover add to it."""

from dataclasses import dataclass, field

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.ground_beneath import GroundBeneath, Standing, find_ground_beneath
from rover_planner.maps.living_map import LivingMap, MapSnapshot, MergeRules
from rover_planner.maps.moved_map import MapMove, move_map

AUTO, MERGE, REPLACE = "auto", "merge", "replace"
MAP_UPDATES = (AUTO, MERGE, REPLACE)
"""Effects of a local map: it merges if there is a loaded map and else replaces the last one; it
always merges; or it always replaces."""


@dataclass(frozen=True)
class KeeperSettings:
    """Settings of a `MapKeeper`."""

    updates: str = AUTO
    """One of MAP_UPDATES."""
    rules: MergeRules = field(default_factory=MergeRules)
    """Rules by which maps merge."""
    fill: bool = True
    """True if unknown cells under the standing rover are filled."""
    margin: float = 0.0
    """Width around the wheels' outline that is filled where the rover started [m]."""
    std: float = 0.02
    """Standard deviation of filled heights on a map that has deviations [m]."""


class MapKeeper:
    """Makes one map of all that a server hears; without ROS."""

    def __init__(self, rover: Rover, settings: KeeperSettings | None = None):
        self._rover = rover
        self._settings = settings or KeeperSettings()
        self._living = LivingMap(self._settings.rules)
        self._start: GroundBeneath | None = None

    def apply(self, rover: Rover, settings: KeeperSettings) -> None:
        """Use another rover and other settings from now on; the map stays."""
        self._rover, self._settings = rover, settings
        self._living.rules = settings.rules

    @property
    def merges(self) -> bool:
        """True if the next local map merges."""
        updates = self._settings.updates
        return updates == MERGE or (updates == AUTO and self._living.has_loaded)

    def load(self, terrain: Terrain, time: float, standing: Standing | None) -> MapSnapshot:
        """Start over with a loaded map.

        Args:
            terrain: The map.
            time: Time of the loading [s].
            standing: The rover, if it was measured just now.
        """
        self._start = None
        self._living.load(terrain, time)
        return self._filled(standing, time)

    def place(self, terrain: Terrain, move: MapMove) -> Terrain:
        """Return a local map of another frame, moved to that of this map and onto its cells.

        Raises:
            PlanningError: As `move_map`.
        """
        grid = self._living.grid_for(terrain) if self.merges else None
        return move_map(terrain, move, grid, self._settings.rules.max_cells)

    def take(
        self, terrain: Terrain, source: str, time: float, standing: Standing | None
    ) -> MapSnapshot:
        """Take a local map.

        Args:
            terrain: The map.
            source: Its topic.
            time: Its stamp [s].
            standing: The rover, if it was measured just now.

        Raises:
            PlanningError: The window would be too large.
            TerrainError: No cell of the window is known.
        """
        if self.merges:
            centre = None if standing is None else (standing.x, standing.y)
            self._living.merge(terrain, source, time, centre)
        else:
            self._living.replace(terrain, source, time)
        return self._filled(standing, time)

    def fill(self, standing: Standing, time: float) -> MapSnapshot | None:
        """Fill unknown cells under the rover; return the map if that changed it, else None.

        Raises:
            PlanningError: The window would be too large.
        """
        if not (self._settings.fill and self._living.has_cells):
            return None
        return self._living.snapshot() if self._fill(standing, time) else None

    def _filled(self, standing: Standing | None, time: float) -> MapSnapshot:
        if self._settings.fill:
            self._fill(standing, time)
        snapshot = self._living.snapshot()
        assert snapshot is not None
        return snapshot

    def _fill(self, standing: Standing | None, time: float) -> bool:
        """Fill the start footprint and the ground under the rover; return whether cells changed.

        Only the start has a margin: elsewhere it would lead on and on over unseen ground.
        """
        changed = False
        if standing is not None:
            now = find_ground_beneath(self._rover, standing)
            changed |= self._fill_with(now, 0.0, time)
            self._start = self._start or now
        if self._start is not None:
            changed |= self._fill_with(self._start, self._settings.margin, time)
        return changed

    def _fill_with(self, ground: GroundBeneath, margin: float, time: float) -> bool:
        grid = self._living.grid
        assert grid is not None
        patch, is_contact = ground.patch(grid, margin, self._settings.std)
        return self._living.fill(patch, is_contact, time)
