"""What is drawn over the ground: candidate paths, where they are refused, start and goal."""

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.quaternions import wxyz_from_rpy
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import Candidate
from rover_planner.viewer.scene.colours import PASSABLE, REFUSED, UNKNOWN, Colour, mix
from rover_planner.viewer.scene.rover_figure import outline_mesh

Floats = NDArray[np.float64]
MAX_GHOSTS = 4
"""Ghosts at a time; more hide what they point at."""
MAX_POINTS = 250
"""Points of a path that are drawn."""
LABEL_WIDTH = 30
"""Letters in a line of a label."""
FADED = 0.6
"""How much of the colour of a path is taken away behind the place where it is refused."""


class PathOverlay:
    """Candidate paths by verdict, and ghosts of the rover where they are refused."""

    def __init__(self, scene: Any):
        self._scene = scene
        self._nodes: list[Any] = []

    def show(
        self, rover: Rover, terrain: Terrain, candidates: Sequence[Candidate], shown: int
    ) -> None:
        """Draw candidates; the one of index `shown` is played, and drawn thicker than the others.

        A ghost on the shown path tells the whole reason, one on another path its number and code.
        """
        self.clear()
        lift = 0.15 * rover.wheel.radius
        order = [*(k for k in range(len(candidates)) if k != shown), shown]
        for index in order:
            self._draw_candidate(
                f"/paths/{index}", terrain, candidates[index], lift, index == shown
            )
        for k, (index, row) in enumerate(choose_ghosts(rover, candidates, shown)):
            verdict = candidates[index].verdict
            if index == shown:
                text = "\n".join(textwrap.wrap(verdict.reasons[row], LABEL_WIDTH))
            else:
                text = f"path {index + 1}: {verdict.codes[row].replace('_', ' ')}"
            self._draw_ghost(f"/ghosts/{k}", rover, terrain, candidates[index], row, text)
        poses = candidates[shown].poses
        for name, pose in (("start", poses[0]), ("goal", poses[-1])):
            self._draw_flag(name, terrain, pose, rover.wheel.radius)

    def show_plan(self, rover: Rover, terrain: Terrain, plan: Floats | None) -> None:
        """Draw one path (n, 3) that somebody else planned, or nothing."""
        self.clear()
        if plan is not None:
            lift = 0.15 * rover.wheel.radius
            self._draw_line("/paths/plan", terrain, plan[:, :2], PASSABLE, lift, True)
            self._draw_flag("goal", terrain, plan[-1], rover.wheel.radius)

    def clear(self) -> None:
        """Take away all that was drawn."""
        for node in self._nodes:
            node.remove()
        self._nodes.clear()

    def _draw_candidate(
        self, name: str, terrain: Terrain, candidate: Candidate, lift: float, wide: bool
    ) -> None:
        """Draw a path in the colour of its verdict, faded from where it is refused."""
        places, verdict = candidate.poses[:, :2], candidate.verdict
        if verdict.traversable:
            self._draw_line(name, terrain, places, PASSABLE, lift, wide)
            return
        end = verdict.first_failure
        beyond = mix(REFUSED, (255, 255, 255), FADED)
        self._draw_line(name, terrain, places[: end + 1], REFUSED, lift, wide)
        self._draw_line(f"{name}-beyond", terrain, places[end:], beyond, lift, wide)

    def _draw_line(
        self, name: str, terrain: Terrain, places: Floats, colour: Colour, lift: float, wide: bool
    ) -> None:
        places = places[_thin(len(places))]
        heights = terrain.elevation_at(places[:, 0], places[:, 1])
        points = np.column_stack([places, heights + lift])[np.isfinite(heights)]
        if len(points) > 1:
            segments = np.stack([points[:-1], points[1:]], axis=1)
            width = 6.0 if wide else 2.5
            self._nodes.append(
                self._scene.add_line_segments(
                    name, segments, colour, thickness=width, thickness_units="screen"
                )
            )

    def _draw_ghost(
        self,
        name: str,
        rover: Rover,
        terrain: Terrain,
        candidate: Candidate,
        row: int,
        text: str,
    ) -> None:
        """Show the rover at a waypoint that is refused, or over it where it does not settle."""
        prediction = candidate.prediction
        x, y, yaw = prediction.poses[row]
        if prediction.settled[row]:
            place = prediction.position[row]
            attitude = wxyz_from_rpy(prediction.roll[row], prediction.pitch[row], yaw)
        else:
            standing = rover.wheel.radius - rover.suspension.wheels["middle"][2]
            place = np.array([x, y, _height(terrain, x, y) + standing])
            attitude = wxyz_from_rpy(0.0, 0.0, yaw)
        mesh = outline_mesh(rover)
        ghost = self._scene.add_mesh_simple(
            name, mesh.vertices, mesh.faces, color=REFUSED, opacity=0.3, cast_shadow=False,
            position=place, wxyz=attitude,
        )  # fmt: skip
        above = np.array([0.0, 0.0, 3.0 * rover.wheel.radius])
        self._scene.add_label(
            f"{name}/reason", text, position=above, anchor="bottom-center", font_screen_scale=0.8
        )
        self._nodes.append(ghost)  # what is below it goes with it

    def _draw_flag(self, name: str, terrain: Terrain, pose: Floats, radius: float) -> None:
        foot = np.array([pose[0], pose[1], _height(terrain, pose[0], pose[1])])
        top = foot + np.array([0.0, 0.0, 6.0 * radius])
        pole = self._scene.add_line_segments(
            f"/flags/{name}", np.array([[foot, top]]), UNKNOWN, thickness=0.1 * radius
        )
        self._scene.add_label(f"/flags/{name}/name", name, position=top, anchor="bottom-center")
        self._nodes.append(pole)


def _thin(count: int) -> NDArray[np.intp]:
    """Return rows of a path to draw, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, MAX_POINTS)).round().astype(np.intp))


def choose_ghosts(
    rover: Rover, candidates: Sequence[Candidate], shown: int
) -> list[tuple[int, int]]:
    """Choose waypoints to show as ghosts: at most MAX_GHOSTS, one and a half wheelbases apart.

    A ghost stands where a stretch of refused waypoints begins. The first failures of all paths
    come before later ones, and those of the shown path before those of the others.

    Returns:
        Indices of candidates, and of a refused waypoint on each.
    """
    order = [shown, *(k for k in range(len(candidates)) if k != shown)]
    stretches = {index: _refused_stretches(candidates[index].verdict.reasons) for index in order}
    first = [(index, rows[0]) for index, rows in stretches.items() if rows]
    later = [(index, row) for index, rows in stretches.items() for row in rows[1:]]
    wheels = rover.suspension.wheels
    apart = 1.5 * (wheels["front"][0] - wheels["rear"][0])
    chosen: list[tuple[int, int]] = []
    for index, row in [*first, *later]:
        here = candidates[index].poses[row, :2]
        taken = [np.hypot(*(candidates[k].poses[other, :2] - here)) for k, other in chosen]
        if len(chosen) < MAX_GHOSTS and all(away >= apart for away in taken):
            chosen.append((index, row))
    return chosen


def _refused_stretches(reasons: tuple[str, ...]) -> list[int]:
    """Return the waypoints at which a stretch of refused ones begins."""
    refused = np.array([bool(reason) for reason in reasons])
    return np.flatnonzero(refused & ~np.concatenate([[False], refused[:-1]])).tolist()


def _height(terrain: Terrain, x: float, y: float) -> float:
    """Return the height of the ground at a place [m], 0 where it is not known."""
    height = float(terrain.elevation_at(x, y))
    return height if np.isfinite(height) else 0.0
