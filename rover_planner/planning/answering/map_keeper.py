# SPDX-License-Identifier: Apache-2.0
"""Keeps the map of a server: what a loaded map, local maps and the standing rover add to it."""

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.ground_beneath import GroundBeneath, Standing, find_ground_beneath
from rover_planner.maps.moved_map import Move, move_map
from rover_planner.parameters.traverse_server import AUTO, MERGE, TraverseServerParameters
from rover_planner.planning.answering.living_map import LivingMap, MapSnapshot


class MapKeeper:
    """Makes one map of all that a server hears; without ROS."""

    def __init__(self, rover: Rover, values: TraverseServerParameters):
        self._rover, self._living = rover, LivingMap(values)
        self._start: GroundBeneath | None = None
        self._taken = ""
        """Fingerprint of the local map that is there alone, but for what is filled; or empty."""

    def apply(self, rover: Rover, values: TraverseServerParameters) -> None:
        """Use another rover and other parameters from now on; the map stays."""
        self._rover, self._living.values, self._taken = rover, values, ""

    @property
    def merges(self) -> bool:
        """True if the next local map merges."""
        updates = self._living.values.map_updates
        return updates == MERGE or (updates == AUTO and self._living.loaded is not None)

    def load(self, terrain: Terrain, time: float, standing: Standing | None) -> MapSnapshot:
        """Start over with a loaded map.

        Args:
            terrain: The map.
            time: Time of the loading [s].
            standing: The rover, if it was measured just now.
        """
        self._start, self._taken = None, ""
        self._living.load(terrain, time)
        return self._filled(standing, time)

    def place(self, terrain: Terrain, move: Move) -> Terrain:
        """Return a local map of another frame, moved to that of this map and onto its cells.

        Raises:
            PlanningError: As `move_map`.
        """
        grid = self._living.grid_for(terrain) if self.merges else None
        return move_map(terrain, move, grid, self._living.values.max_map_cells)

    def take(
        self, terrain: Terrain, source: str, time: float, standing: Standing | None
    ) -> MapSnapshot:
        """Take a local map; one that is published again keeps what was filled under the rover.

        Args:
            terrain: The map.
            source: Its topic.
            time: Its stamp [s].
            standing: The rover, if it was measured just now.

        Raises:
            PlanningError: The window would be too large.
            TerrainError: No cell of the window is known.
        """
        content = "" if self.merges else terrain.fingerprint
        if self.merges:
            centre = None if standing is None else (standing.pose[0], standing.pose[1])
            self._living.merge(terrain, source, time, centre)
        elif content != self._taken:
            self._living.replace(terrain, source, time)
        self._taken = content
        return self._filled(standing, time)

    def fill(self, standing: Standing, time: float) -> MapSnapshot | None:
        """Fill unknown cells under the rover; return the map if that changed it, else None.

        Raises:
            PlanningError: The window would be too large.
        """
        return self._living.snapshot() if self._fill(standing, time) else None

    def _filled(self, standing: Standing | None, time: float) -> MapSnapshot:
        self._fill(standing, time)
        snapshot = self._living.snapshot()
        assert snapshot is not None
        return snapshot

    def _fill(self, standing: Standing | None, time: float) -> bool:
        """Fill the start footprint and the ground under the rover; return whether cells changed.

        Only the start has a margin: elsewhere it would lead on and on over unseen ground.
        """
        values, grid = self._living.values, self._living.grid
        if grid is None or not values.fill_under_rover:
            return False
        grounds = []
        if standing is not None:
            now = find_ground_beneath(self._rover, standing)
            grounds.append((now, 0.0))
            self._start = self._start or now
        if self._start is not None:
            grounds.append((self._start, values.footprint_margin))
        changed = False
        for ground, margin in grounds:
            patch, is_contact = ground.patch(grid, margin, values.footprint_std)
            changed |= self._living.fill(patch, is_contact, time)
        return changed
