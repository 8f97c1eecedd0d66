"""What is drawn over the ground: candidate paths, where they are refused, start, goal, forces."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover import Rover
from rover_physics.terrain import Terrain
from rover_planner.path_query import Candidate, PathAnswer
from rover_planner.viewer.colours import CHOSEN, LOAD, PASSABLE, PULL, REFUSED
from rover_planner.viewer.journey import Frame
from rover_planner.viewer.rotations import matrix_of, of_attitude
from rover_planner.viewer.rover_figure import outline_mesh

Floats = NDArray[np.float64]
MOST_GHOSTS = 6


class PathOverlay:
    """Candidate paths by verdict, and ghosts of the rover where they are refused."""

    def __init__(self, scene: Any):
        self._scene = scene
        self._nodes: list[Any] = []

    def show(self, rover: Rover, terrain: Terrain, answer: PathAnswer, shown: Candidate) -> None:
        """Draw an answer anew; `shown` is the path that is played."""
        for node in self._nodes:
            node.remove()
        self._nodes.clear()
        lift = 0.15 * rover.wheel.radius
        others = [c for c in answer.candidates if c.poses is not shown.poses]
        for k, candidate in enumerate([*others, shown]):
            colour = PASSABLE if candidate.verdict.traversable else REFUSED
            wide = candidate is shown
            colour = CHOSEN if wide else colour
            self._draw_line(f"/paths/{k}", terrain, candidate.poses, colour, lift, wide)
        refused = [c for c in [shown, *others] if not c.verdict.traversable]
        for k, candidate in enumerate(refused[:MOST_GHOSTS]):
            self._draw_ghost(f"/ghosts/{k}", rover, terrain, candidate)
        for name, pose in (("start", shown.poses[0]), ("goal", shown.poses[-1])):
            self._draw_flag(name, terrain, pose, rover.wheel.radius)

    def show_plan(self, rover: Rover, terrain: Terrain, plan: Floats | None) -> None:
        """Draw one path (n, 3) that somebody else planned, or nothing."""
        for node in self._nodes:
            node.remove()
        self._nodes.clear()
        if plan is not None:
            self._draw_line("/paths/plan", terrain, plan, CHOSEN, 0.15 * rover.wheel.radius, True)
            self._draw_flag("goal", terrain, plan[-1], rover.wheel.radius)

    def _draw_line(
        self, name: str, terrain: Terrain, poses: Floats, colour: Any, lift: float, wide: bool
    ) -> None:
        places = poses[:: max(1, len(poses) // 200), :2]
        heights = terrain.elevation_at(places[:, 0], places[:, 1])
        points = np.column_stack([places, heights + lift])
        points = points[np.isfinite(heights)]
        if len(points) > 1:
            segments = np.stack([points[:-1], points[1:]], axis=1)
            self._nodes.append(
                self._scene.add_line_segments(
                    name,
                    segments,
                    colour,
                    thickness=5.0 if wide else 2.5,
                    thickness_units="screen",
                )
            )

    def _draw_ghost(self, name: str, rover: Rover, terrain: Terrain, candidate: Candidate) -> None:
        """Show the rover at the waypoint that is refused, or over it where it does not settle."""
        verdict, prediction = candidate.verdict, candidate.prediction
        row = verdict.first_failure
        x, y, yaw = prediction.poses[row]
        if prediction.settled[row]:
            place = prediction.position[row]
            attitude = of_attitude(prediction.roll[row], prediction.pitch[row], yaw)
        else:
            height = float(terrain.elevation_at(x, y))
            standing = rover.wheel.radius - rover.suspension.wheels["middle"][2]
            place = np.array([x, y, (height if np.isfinite(height) else 0.0) + standing])
            attitude = of_attitude(0.0, 0.0, yaw)
        mesh = outline_mesh(rover)
        self._nodes.append(
            self._scene.add_mesh_simple(
                name, mesh.vertices, mesh.faces, color=REFUSED, opacity=0.3,
                position=place, wxyz=attitude,
            )
        )  # fmt: skip
        above = np.array([0.0, 0.0, 3.0 * rover.wheel.radius])
        self._nodes.append(self._scene.add_label(f"{name}/reason", verdict.reason, position=above))

    def _draw_flag(self, name: str, terrain: Terrain, pose: Floats, radius: float) -> None:
        height = float(terrain.elevation_at(pose[0], pose[1]))
        place = np.array(
            [pose[0], pose[1], (height if np.isfinite(height) else 0.0) + 6.0 * radius]
        )
        self._nodes.append(self._scene.add_label(f"/flags/{name}", name, position=place))


class ForceArrows:
    """Arrows at the contacts: normal forces, and what the wheels pull along the ground."""

    def __init__(self, scene: Any, rover: Rover):
        self._scale = 4.0 * rover.wheel.radius / (rover.weight / 6.0)
        radius = rover.wheel.radius
        nothing = np.zeros((6, 2, 3))
        sizes = {
            "shaft_radius": 0.07 * radius,
            "head_radius": 0.16 * radius,
            "head_length": 0.35 * radius,
        }
        self._normal = scene.add_arrows("/forces/normal", nothing, LOAD, **sizes)
        self._along = scene.add_arrows("/forces/along", nothing, PULL, **sizes)

    def show(self, frame: Frame) -> None:
        """Draw the forces of the ground on the wheels; their length is in proportion."""
        R = matrix_of(*frame.attitude)
        axis = R[:, 1]
        out = frame.wheel_centres - frame.contact_points
        normal = out - np.outer(out @ axis, axis)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        along = np.cross(axis, normal)
        points = frame.contact_points
        loads = self._scale * frame.wheel_loads[:, None] * normal
        pulls = self._scale * (frame.tangential[:, None] * along + frame.lateral[:, None] * axis)
        self._normal.points = np.stack([points, points + loads], axis=1)
        self._along.points = np.stack([points, points + pulls], axis=1)

    @property
    def visible(self) -> bool:
        """Whether they are shown."""
        return bool(self._normal.visible)

    @visible.setter
    def visible(self, value: bool) -> None:
        self._normal.visible = self._along.visible = value
