# SPDX-License-Identifier: Apache-2.0
"""Drawings over the ground: candidate paths with their numbers, refused places, start, goal."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import Candidate
from rover_planner.viewer.scene.canvas import Canvas, Strand
from rover_planner.viewer.state.colours import (
    PASSABLE,
    REFUSED,
    UNKNOWN,
    Colour,
    blend,
    map_colours,
)

MAX_POINTS = 250
"""Most points of a path that are drawn."""
FADE = 0.6
"""Share of white in the colour of a path behind the waypoint that is refused."""
WHITE = (255, 255, 255)
GHOST = (143, 74, 115)
"""Colour of a path that a person points at."""
CLEARANCE = 0.15
"""Height of a path above the ground [wheel radii]."""
CROSS = 0.7
"""Half the width of the cross where a path is refused [wheel radii]."""
WIDE, NARROW = 6.0, 3.5
"""Widths of the shown path and of the others [px]."""
NUMBER_SHARES = (0.35, 0.65)
"""Shares of a path at which the numbers of the first and the last one stand."""
PATHS, NUMBERS, FLAGS = "/paths", "/numbers", "/flags"
"""Groups of nodes."""
NUMBER_HEIGHT = 1.5
"""Height of a path's number above the ground [wheel radii]."""
NUMBER_ANGLE = 0.018
"""Half the angle under which a number is seen [rad]: a click within it is one on the number."""
SHOWN_SIZE = 1.6
"""Size of the number of the shown path, relative to the others."""


class PathOverlay:
    """Candidate paths in the colours of their verdicts, with their numbers."""

    def __init__(self, canvas: Canvas):
        """Draw nothing yet."""
        self._canvas = canvas
        self.paths: list[Sequence[Strand]] = []
        """The candidate paths as they are drawn."""
        self.lines: dict[str, Sequence[Strand]] = {}
        """What else is drawn, by name: a plan, a ghost, a trail."""
        self._shown = 0
        self._old: frozenset[int] = frozenset()
        """Indices of the paths that are greyed."""
        self._numbers: dict[int, Floats] = {}
        """Places of the numbers by the index of their path [m]."""

    def show(
        self, rover: Rover, terrain: Terrain, candidates: Sequence[Candidate], shown: int
    ) -> None:
        """Draw candidate paths instead of what was drawn before.

        Args:
            rover: The rover.
            terrain: The ground.
            candidates: The paths.
            shown: Index of the path that is played; it is drawn wider than the others.
        """
        radius = rover.wheel.radius
        self.paths = [self._find_strands(terrain, one, radius) for one in candidates]
        self._shown = shown
        self._canvas.remove(PATHS, [f"{PATHS}/{index}" for index in range(len(candidates))])
        self._draw_paths()
        poses = candidates[shown].poses
        self._draw_numbers(terrain, candidates, radius, shown)
        self._draw_flags(terrain, {"start": poses[0], "goal": poses[-1]}, radius)

    def show_plan(
        self, rover: Rover, terrain: Terrain, plan: Floats | None, is_old: bool = False
    ) -> None:
        """Draw a path (n, 3) without a verdict of ours, or none, instead of what was drawn.

        An old one is grey.
        """
        self.show_line("plan", rover, terrain, plan, UNKNOWN if is_old else PASSABLE)
        flags = {} if plan is None else {"goal": plan[-1]}
        self._draw_flags(terrain, flags, rover.wheel.radius)

    def show_line(
        self, name: str, rover: Rover, terrain: Terrain, path: Floats | None, colour: Colour
    ) -> None:
        """Draw a path (n, 3), or none, instead of the one that had the name."""
        points = np.empty((0, 2)) if path is None else path[:, :2]
        height = CLEARANCE * rover.wheel.radius
        self._draw(name, self._find_strand(terrain, points, colour, height))

    def show_trail(self, rover: Rover, terrain: Terrain, trail: Floats | None) -> None:
        """Draw where (n, 3) something was learned: x, y [m] and a number from 0 to 1."""
        known = np.empty((0, 3)) if trail is None else trail
        height, colours = CLEARANCE * rover.wheel.radius, map_colours(known[:, 2], 0.0, 1.0)
        strands = [
            strand
            for k, (red, green, blue) in enumerate(colours[1:].tolist())
            for strand in self._find_strand(
                terrain, known[k : k + 2, :2], (red, green, blue), height
            )
        ]
        self._draw("trail", strands)

    def find_number(self, origin: Floats, direction: Floats) -> int | None:
        """Return the index of the path whose number a ray hits; None for none.

        Args:
            origin: (3,) start of the ray, a camera [m].
            direction: (3,) its direction, of length 1.
        """
        for index, place in self._numbers.items():
            away = place - origin
            aside = np.linalg.norm(np.cross(direction, away))
            if direction @ away > 0.0 and aside < NUMBER_ANGLE * np.linalg.norm(away):
                return index
        return None

    def mark_old(self, indices: frozenset[int]) -> None:
        """Grey the lines of paths whose verdicts are of old values, and colour all others."""
        if indices == self._old:
            return
        self._old = indices
        self._draw_paths()

    def _draw_paths(self) -> None:
        for index, strands in enumerate(self.paths):
            width = WIDE if index == self._shown else NARROW
            paint = UNKNOWN if index in self._old else None
            self._canvas.show_lines(f"{PATHS}/{index}", strands, width, paint)

    def _draw(self, name: str, strands: Sequence[Strand]) -> None:
        """Draw some lines instead of those that had the name."""
        self.lines[name] = strands
        self._canvas.show_lines(f"/lines/{name}", strands, WIDE)

    def _find_strands(self, terrain: Terrain, candidate: Candidate, radius: float) -> list[Strand]:
        """Return a path in the colour of its verdict, faded from where it is refused."""
        points, verdict = candidate.poses[:, :2], candidate.verdict
        height = CLEARANCE * radius
        if verdict.traversable:
            return self._find_strand(terrain, points, PASSABLE, height)
        end = verdict.first_failure
        arms = CROSS * radius * np.array([[1.0, 1.0], [1.0, -1.0]])
        crossing = [np.array([points[end] - arm, points[end] + arm]) for arm in arms]
        return [
            *self._find_strand(terrain, points[: end + 1], REFUSED, height),
            *self._find_strand(terrain, points[end:], blend(REFUSED, WHITE, FADE), height),
            *(
                strand
                for arm in crossing
                for strand in self._find_strand(terrain, arm, REFUSED, 2.0 * height)
            ),
        ]

    def _find_strand(
        self, terrain: Terrain, points: Floats, colour: Colour, height: float
    ) -> list[Strand]:
        """Return a strand through points (n, 2) at a height above the ground [m].

        There is none where fewer than two points are on known ground.
        """
        points = points[_thin(len(points))]
        ground = terrain.elevation_at(points[:, 0], points[:, 1])
        line = np.column_stack([points, ground + height])[np.isfinite(ground)]
        return [Strand(line, colour)] if len(line) > 1 else []

    def _draw_numbers(
        self, terrain: Terrain, candidates: Sequence[Candidate], radius: float, shown: int
    ) -> None:
        """Write the number of each path on it, one after another if there are several."""
        self._numbers.clear()
        shares = np.linspace(*NUMBER_SHARES, len(candidates))
        for index, candidate in enumerate(candidates if len(candidates) > 1 else ()):
            x, y, _ = candidate.poses[round(shares[index] * (len(candidate.poses) - 1))]
            height = _ground_height(terrain, x, y) + NUMBER_HEIGHT * radius
            self._numbers[index] = np.array([x, y, height])
        self._canvas.remove(NUMBERS, [f"{NUMBERS}/{index}" for index in self._numbers])
        for index, place in self._numbers.items():
            size = SHOWN_SIZE if index == shown else 1.0
            self._canvas.show_label(
                f"{NUMBERS}/{index}", str(index + 1), place, font_screen_scale=size,
                anchor="center-center",
            )  # fmt: skip

    def _draw_flags(self, terrain: Terrain, flags: Mapping[str, Floats], radius: float) -> None:
        """Draw poles of six wheel radii [m] with names at poses (3,)."""
        self._canvas.remove(FLAGS, [f"{FLAGS}/{name}" for name in flags])
        poles = []
        for name, (x, y, *_) in flags.items():
            foot = np.array([x, y, _ground_height(terrain, x, y)])
            top = foot + np.array([0.0, 0.0, 6.0 * radius])
            poles.append(Strand(np.array([foot, top]), UNKNOWN))
            self._canvas.show_label(f"{FLAGS}/{name}", name, top)
        self._canvas.show_lines("/poles", poles, NARROW)


def _thin(count: int) -> NDArray[np.intp]:
    """Return at most MAX_POINTS rows of `count`, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, MAX_POINTS)).round().astype(np.intp))


def _ground_height(terrain: Terrain, x: float, y: float) -> float:
    """Return the height of the ground at a point [m], 0 where it is not known."""
    height = float(terrain.elevation_at(x, y))
    return height if np.isfinite(height) else 0.0
