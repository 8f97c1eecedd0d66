"""Drawings over the ground: candidate paths, ghosts where they are refused, start and goal."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import wxyz_from_rpy
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import Candidate
from rover_planner.viewer.scene.rover_visual import make_ghost
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN, Colour, blend

MAX_GHOSTS = 4
"""Most ghosts at a time; more of them hide the ground."""
MAX_POINTS = 250
"""Most points of a path that are drawn."""
LABEL_WIDTH = 30
"""Most letters in a line of a label."""
FADE = 0.6
"""Share of white in the colour of a path behind the waypoint that is refused."""
WHITE = (255, 255, 255)
CLEARANCE = 0.15
"""Height of a path above the ground [wheel radii]."""


class PathOverlay:
    """Candidate paths in the colours of their verdicts, and ghosts of the rover on them."""

    def __init__(self, scene: Any):
        """Draw nothing yet."""
        self._scene = scene
        self._nodes: list[Any] = []
        self._coloured: list[tuple[int, Any, Any]] = []
        """Lines with the index of their path and their colour (3,)."""
        self._old: set[int] = set()
        """Indices of the paths that are greyed."""

    def show(
        self, rover: Rover, terrain: Terrain, candidates: Sequence[Candidate], shown: int
    ) -> None:
        """Draw candidate paths instead of what was drawn before.

        The label of a ghost gives the whole reason on the shown path, else the path's number and
        the code of the reason.

        Args:
            rover: The rover.
            terrain: The ground.
            candidates: The paths.
            shown: Index of the path that is played; it is drawn wider than the others.
        """
        self.clear()
        height = CLEARANCE * rover.wheel.radius
        for index in sorted(range(len(candidates)), key=lambda index: index == shown):
            first = len(self._nodes)
            self._draw_candidate(
                f"/paths/{index}", terrain, candidates[index], height, index == shown
            )
            self._coloured += [(index, node, node.colors) for node in self._nodes[first:]]
        ghosts = choose_ghosts(rover, candidates, shown)
        mesh = make_ghost(rover) if ghosts else None
        for k, (index, row) in enumerate(ghosts):
            verdict = candidates[index].verdict
            if index == shown:
                text = "\n".join(textwrap.wrap(verdict.reasons[row], LABEL_WIDTH))
            else:
                text = f"path {index + 1}: {verdict.codes[row].replace('_', ' ')}"
            place = _place_ghost(rover, terrain, candidates[index], row)
            self._draw_ghost(f"/ghosts/{k}", mesh, place, 3.0 * rover.wheel.radius, text)
        poses = candidates[shown].poses
        for name, pose in (("start", poses[0]), ("goal", poses[-1])):
            self._draw_flag(name, terrain, pose, rover.wheel.radius)

    def show_plan(self, rover: Rover, terrain: Terrain, plan: Floats | None) -> None:
        """Draw a path (n, 3) without a verdict of ours, or none, instead of what was drawn."""
        self.clear()
        if plan is not None:
            height = CLEARANCE * rover.wheel.radius
            self._draw_line("/paths/plan", terrain, plan[:, :2], PASSABLE, height, True)
            self._draw_flag("goal", terrain, plan[-1], rover.wheel.radius)

    def clear(self) -> None:
        """Remove all that was drawn."""
        for node in self._nodes:
            node.remove()
        self._nodes.clear()
        self._coloured.clear()
        self._old.clear()

    def mark_old(self, indices: Iterable[int]) -> None:
        """Grey the lines of paths whose verdicts are of old values, and colour all others."""
        old = set(indices)
        for index, line, colour in self._coloured:
            if (index in old) != (index in self._old):
                line.colors = np.array(UNKNOWN, np.uint8) if index in old else colour
        self._old = old

    def _draw_candidate(
        self, name: str, terrain: Terrain, candidate: Candidate, height: float, wide: bool
    ) -> None:
        """Draw a path in the colour of its verdict, faded from where it is refused."""
        points, verdict = candidate.poses[:, :2], candidate.verdict
        if verdict.traversable:
            self._draw_line(name, terrain, points, PASSABLE, height, wide)
            return
        end = verdict.first_failure
        faded = blend(REFUSED, WHITE, FADE)
        self._draw_line(name, terrain, points[: end + 1], REFUSED, height, wide)
        self._draw_line(f"{name}-beyond", terrain, points[end:], faded, height, wide)

    def _draw_line(
        self,
        name: str,
        terrain: Terrain,
        points: Floats,
        colour: Colour,
        height: float,
        wide: bool,
    ) -> None:
        """Draw a line through points (n, 2) at a height above the ground [m]."""
        points = points[_thin(len(points))]
        ground = terrain.elevation_at(points[:, 0], points[:, 1])
        line = np.column_stack([points, ground + height])[np.isfinite(ground)]
        if len(line) > 1:
            segments = np.stack([line[:-1], line[1:]], axis=1)
            width = 6.0 if wide else 2.5
            self._nodes.append(
                self._scene.add_line_segments(
                    name, segments, colour, thickness=width, thickness_units="screen"
                )
            )

    def _draw_ghost(
        self, name: str, mesh: Any, place: tuple[Floats, Floats], height: float, text: str
    ) -> None:
        """Draw the rover's mesh at a position and attitude, and a label above it [m]."""
        position, attitude = place
        ghost = self._scene.add_mesh_simple(
            name, mesh.vertices, mesh.faces, color=REFUSED, opacity=0.3, cast_shadow=False,
            position=position, wxyz=attitude,
        )  # fmt: skip
        above = np.array([0.0, 0.0, height])
        self._scene.add_label(
            f"{name}/reason", text, position=above, anchor="bottom-center", font_screen_scale=0.8
        )
        self._nodes.append(ghost)  # its label is removed with it

    def _draw_flag(self, name: str, terrain: Terrain, pose: Floats, radius: float) -> None:
        """Draw a pole of six wheel radii [m] with a name at a pose."""
        foot = np.array([pose[0], pose[1], _ground_height(terrain, pose[0], pose[1])])
        top = foot + np.array([0.0, 0.0, 6.0 * radius])
        pole = self._scene.add_line_segments(
            f"/flags/{name}", np.array([[foot, top]]), UNKNOWN, thickness=0.1 * radius
        )
        self._scene.add_label(f"/flags/{name}/name", name, position=top, anchor="bottom-center")
        self._nodes.append(pole)


def _thin(count: int) -> NDArray[np.intp]:
    """Return at most MAX_POINTS rows of `count`, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, MAX_POINTS)).round().astype(np.intp))


def choose_ghosts(
    rover: Rover, candidates: Sequence[Candidate], shown: int
) -> list[tuple[int, int]]:
    """Choose waypoints to show as ghosts: at most MAX_GHOSTS, 1.5 wheelbases apart.

    A ghost stands where a stretch of refused waypoints begins. The first failures of all paths
    come before later ones, and those of the shown path before those of the others.

    Args:
        rover: The rover.
        candidates: The paths.
        shown: Index of the path that is played.

    Returns:
        Indices of candidates, and of a refused waypoint on each.
    """
    order = [shown, *(k for k in range(len(candidates)) if k != shown)]
    stretches = {index: _refused_stretches(candidates[index].verdict.reasons) for index in order}
    first = [(index, rows[0]) for index, rows in stretches.items() if rows]
    later = [(index, row) for index, rows in stretches.items() for row in rows[1:]]
    wheels = rover.suspension.wheels
    min_distance = 1.5 * (wheels["front"][0] - wheels["rear"][0])
    chosen: list[tuple[int, int]] = []
    for index, row in [*first, *later]:
        here = candidates[index].poses[row, :2]
        distances = [np.hypot(*(candidates[k].poses[other, :2] - here)) for k, other in chosen]
        if len(chosen) < MAX_GHOSTS and all(distance >= min_distance for distance in distances):
            chosen.append((index, row))
    return chosen


def _place_ghost(
    rover: Rover, terrain: Terrain, candidate: Candidate, row: int
) -> tuple[Floats, Floats]:
    """Return position (3,) and attitude (4,), w first, of the rover at a waypoint.

    Where it does not settle it is level above the ground.
    """
    prediction = candidate.prediction
    x, y, yaw = prediction.poses[row]
    if prediction.settled[row]:
        attitude = wxyz_from_rpy(prediction.roll[row], prediction.pitch[row], yaw)
        return prediction.position[row], attitude
    standing = rover.wheel.radius - rover.suspension.wheels["middle"][2]
    position = np.array([x, y, _ground_height(terrain, x, y) + standing])
    return position, wxyz_from_rpy(0.0, 0.0, yaw)


def _refused_stretches(reasons: tuple[str, ...]) -> list[int]:
    """Return the waypoints at which a stretch of refused ones begins."""
    refused = np.array([bool(reason) for reason in reasons])
    return np.flatnonzero(refused & ~np.concatenate([[False], refused[:-1]])).tolist()


def _ground_height(terrain: Terrain, x: float, y: float) -> float:
    """Return the height of the ground at a point [m], 0 where it is not known."""
    height = float(terrain.elevation_at(x, y))
    return height if np.isfinite(height) else 0.0
