"""Grounds and random pairs of poses between which ways are searched."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from benchmarks.grounds import real_maps
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.lattice.judge import Judge
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.ways.question import WayQuestion
from rover_planner.worlds.mars_terrain import make_mars_terrain

Pair = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Start and goal, (3,) each."""
NEAREST, FURTHEST = 4.0, 20.0
"""Distances of start and goal [m]."""
MADE = {
    "rocks": {"seed": 17, "rock_cover": 0.2, "crater_density": 0.0},
    "craters": {"seed": 18, "rock_cover": 0.01, "crater_density": 0.1},
}
"""Arguments of the made Mars terrains, 24 x 24 m at 5 cm."""
_DRAWN = 2000
"""Number of poses drawn at a time."""


def grounds() -> dict[str, Terrain]:
    """Return the grounds by name: the real maps and two made Mars terrains."""
    made = {name: make_mars_terrain(**arguments) for name, arguments in MADE.items()}
    return {**real_maps(), **made}


@dataclass(frozen=True, eq=False)
class Case:
    """A rover on a ground."""

    name: str
    """Name of the ground."""
    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground."""
    policy: str
    """Torque policy."""

    @cached_property
    def options(self) -> PathQueryOptions:
        """The options of `rover_planner plan`."""
        return PathQueryOptions(policy=self.policy, control_margin=0.0)

    @property
    def judge(self) -> Judge:
        """A new judge."""
        return Judge(self.rover, self.terrain, self.options)

    def question(self, pair: Pair, terrain: Terrain | None = None) -> WayQuestion:
        """Return the question for a way between two poses."""
        return WayQuestion(self.rover, terrain or self.terrain, *pair, self.options)

    def pairs(self, count: int, seed: int) -> list[Pair]:
        """Return random pairs of poses on which the rover can stand, NEAREST to FURTHEST apart."""
        rng, found = np.random.default_rng(seed), []
        standing = self._standing(rng)
        start, misses = next(standing), 0
        while len(found) < count:
            goal = next(standing)
            if NEAREST <= np.hypot(*(goal - start)[:2]) <= FURTHEST:
                found.append((start, goal))
                start, misses = next(standing), 0
            elif (misses := misses + 1) > 100:
                start, misses = next(standing), 0
        return found

    def _standing(self, rng: np.random.Generator) -> Iterator[NDArray[np.float64]]:
        """Yield random poses (3,) on which the rover can stand, without end."""
        xmin, xmax, ymin, ymax = self.terrain.bounds
        low, high = (xmin, ymin, -np.pi), (xmax, ymax, np.pi)
        while True:
            poses = rng.uniform(low, high, (_DRAWN, 3))
            codes = self.judge.stand(poses)
            if not any(code == "" for code in codes):
                raise ValueError(f"the rover stands at none of {_DRAWN} poses on {self.name}")
            yield from poses[[code == "" for code in codes]]
