# SPDX-License-Identifier: Apache-2.0
"""Drawings over the ground: candidate paths with their numbers, refused places, start, goal."""

from collections.abc import Mapping, Sequence

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.scene.canvas import Canvas, Strand
from rover_planner.viewer.state.colours import (
    BEYOND,
    PASSABLE,
    REFUSED,
    UNKNOWN,
    Colour,
    map_colours,
)
from rover_planner.viewer.state.scenario import JudgedPath

MAX_POINTS = 250
"""Most points of a path that are drawn."""
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
PATHS, NUMBERS, FLAGS, LINES = "/paths", "/numbers", "/flags", "/lines"
"""Groups of nodes."""
NUMBER_HEIGHT = 1.5
"""Height of a path's number above the ground [wheel radii]."""
POLE = 6.0
"""Height of the poles at start and goal [wheel radii]."""
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
        self._shown = 0
        self._old: frozenset[int] = frozenset()
        """Indices of the paths that are greyed."""
        self._numbers: Floats = np.empty((0, 3))
        """Places of the numbers of the paths [m]; none for a single path."""

    def show(self, paths: Sequence[JudgedPath], shown: int) -> None:
        """Draw paths instead of what was drawn before; `shown` is played, and wider."""
        self.paths, self._shown = [self._find_strands(one) for one in paths], shown
        self._canvas.remove(PATHS, [f"{PATHS}/{index}" for index in range(len(paths))])
        self._draw_paths()
        self._draw_numbers(paths)
        poses = paths[shown].poses
        self._draw_flags({"start": poses[0], "goal": poses[-1]})

    def show_plan(self, plan: Floats | None, is_old: bool = False) -> None:
        """Draw a path (n, 3) without a verdict of ours, or none, instead of what was drawn.

        An old one is grey.
        """
        self.show_line("plan", plan, UNKNOWN if is_old else PASSABLE)
        self._draw_flags({} if plan is None else {"goal": plan[-1]})

    def show_line(self, name: str, path: Floats | None, colour: Colour) -> None:
        """Draw a path (n, 3), or none, instead of the one that had the name."""
        strands = [] if path is None else [self._find_strand(path[:, :2], colour)]
        self._canvas.show_lines(f"{LINES}/{name}", strands, WIDE)

    def show_trail(self, trail: Floats) -> None:
        """Draw where (n, 3) something was learned: x, y [m] and a number from 0 to 1."""
        colours = map_colours(trail[1:, 2], 0.0, 1.0).tolist()
        strands = [
            self._find_strand(trail[k : k + 2, :2], (red, green, blue))
            for k, (red, green, blue) in enumerate(colours)
        ]
        self._canvas.show_lines(f"{LINES}/trail", strands, WIDE)

    def find_number(self, origin: Floats, direction: Floats) -> int | None:
        """Return the index of the path whose number a ray hits; None for none.

        Args:
            origin: (3,) start of the ray, a camera [m].
            direction: (3,) its direction, of length 1.
        """
        away = self._numbers - origin
        aside = np.linalg.norm(np.cross(direction, away), axis=1)
        hit = (away @ direction > 0.0) & (aside < NUMBER_ANGLE * np.linalg.norm(away, axis=1))
        return int(hit.argmax()) if hit.any() else None

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

    def _find_strands(self, path: JudgedPath) -> list[Strand]:
        """Return a path in the colour of its verdict, faded from where it is refused."""
        points, verdict = path.poses[:, :2], path.verdict
        if verdict.traversable:
            return [self._find_strand(points, PASSABLE)]
        end = verdict.first_failure
        arms = CROSS * self._canvas.radius * np.array([[1.0, 1.0], [1.0, -1.0]])
        cross = [np.array([points[end] - arm, points[end] + arm]) for arm in arms]
        return [
            self._find_strand(points[: end + 1], REFUSED),
            self._find_strand(points[end:], BEYOND),
            *(self._find_strand(line, REFUSED, 2.0 * CLEARANCE) for line in cross),
        ]

    def _find_strand(self, points: Floats, colour: Colour, height: float = CLEARANCE) -> Strand:
        """Return a strand through points (n, 2) at a height above the ground [wheel radii].

        It leaves out points on unknown ground.
        """
        rows = np.linspace(0, len(points) - 1, min(len(points), MAX_POINTS)).round().astype(int)
        line = self._canvas.lay(points[rows], height)
        return Strand(line[np.isfinite(line[:, 2])], colour)

    def _draw_numbers(self, paths: Sequence[JudgedPath]) -> None:
        """Write the number of each path on it, one after another if there are several."""
        shares = np.linspace(*NUMBER_SHARES, len(paths))
        places = [
            one.poses[round(share * (len(one.poses) - 1)), :2]
            for one, share in zip(paths, shares, strict=True)
        ]
        self._numbers = self._canvas.lay(places if len(places) > 1 else [], NUMBER_HEIGHT, 0.0)
        self._canvas.remove(NUMBERS, [f"{NUMBERS}/{k}" for k in range(len(self._numbers))])
        for k, place in enumerate(self._numbers):
            size = SHOWN_SIZE if k == self._shown else 1.0
            self._canvas.show_label(
                f"{NUMBERS}/{k}", str(k + 1), place, font_screen_scale=size,
                anchor="center-center",
            )  # fmt: skip

    def _draw_flags(self, flags: Mapping[str, Floats]) -> None:
        """Draw poles with names at poses (3,)."""
        self._canvas.remove(FLAGS, [f"{FLAGS}/{name}" for name in flags])
        poles = []
        for name, pose in flags.items():
            (foot,), (top,) = (self._canvas.lay([pose[:2]], high, 0.0) for high in (0.0, POLE))
            poles.append(Strand(np.array([foot, top]), UNKNOWN))
            self._canvas.show_label(f"{FLAGS}/{name}", name, top)
        self._canvas.show_lines("/poles", poles, NARROW)
