"""The articulated rover in the scene, built from the numbers of its file."""

import itertools
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import trimesh
from numpy.typing import NDArray

from rover_physics.names import SIDES, WHEEL_POSITIONS, WHEELS
from rover_physics.numerics.quaternions import wxyz_about_y, wxyz_from_rpy
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator, Rover
from rover_planner.viewer.scene.colours import BODY, DARK, METAL, of_use
from rover_planner.viewer.state.journey import Frame

Floats = NDArray[np.float64]
Meshes = Mapping[str, trimesh.Trimesh]
GROUSERS = 16


class RoverFigure:
    """Nodes of the scene: body, rockers, bogies, wheels and arm, each turning about its joint."""

    def __init__(self, scene: Any, rover: Rover, name: str = "/rover", arm_angles: Any = None):
        """Build the figure under a node `name`; it replaces what was there."""
        self._scene, self._name = scene, name
        self._root = scene.add_frame(name, show_axes=False)
        self._joints: dict[str, Any] = {}
        self._tyres: list[Any] = []
        self._add("body", body_mesh(rover), BODY)
        for side in SIDES:
            self._build_side(rover, side)
        self.turn_arm(rover, arm_angles or {})

    def _add(self, name: str, mesh: trimesh.Trimesh, colour: tuple[int, int, int]) -> Any:
        return self._scene.add_mesh_simple(
            f"{self._name}/{name}", mesh.vertices, mesh.faces, color=colour, flat_shading=True
        )

    def _joint(self, key: str, path: str, place: Floats) -> None:
        self._joints[key] = self._scene.add_frame(
            f"{self._name}/{path}", show_axes=False, position=place
        )

    def _build_side(self, rover: Rover, side: str) -> None:
        suspension = rover.suspension
        rocker, bogie = (
            mirrored(point, side) for point in (suspension.rocker_pivot, suspension.bogie_pivot)
        )
        own = mirrored(suspension.wheels[suspension.rocker_wheel], side)
        above, below = f"rocker_{side}", f"rocker_{side}/bogie"
        self._joint(above, above, rocker)
        self._joint(f"bogie_{side}", below, bogie - rocker)
        thick = 0.16 * rover.wheel.radius
        beams = [beam(np.zeros(3), bogie - rocker, thick), beam(np.zeros(3), own - rocker, thick)]
        self._add(f"{above}/beams", joined(beams), METAL)
        ends = [
            mirrored(suspension.wheels[name], side) - bogie for name in suspension.bogie_wheels
        ]
        beams = [beam(np.zeros(3), end, thick) for end in ends]
        self._add(f"{below}/beams", joined(beams), METAL)
        for position in WHEEL_POSITIONS:
            hung = position in suspension.bogie_wheels
            place = mirrored(suspension.wheels[position], side) - (bogie if hung else rocker)
            path = f"{below if hung else above}/{position}"
            self._joint(f"{position}_{side}", path, place)
            tyre, grousers = wheel_meshes(rover)
            self._tyres.append(self._add(f"{path}/tyre", tyre, METAL))
            self._add(f"{path}/grousers", grousers, DARK)

    def turn_arm(self, rover: Rover, angles: Mapping[str, float]) -> None:
        """Show the arm at angles [rad] by joint name, stowed where not given."""
        if rover.manipulator is not None:
            self._add("arm", arm_mesh(rover.manipulator, angles, rover.wheel.radius), DARK)

    def show(self, frame: Frame) -> None:
        """Bring the figure to a frame."""
        self._root.position = frame.position
        self._root.wxyz = wxyz_from_rpy(*frame.attitude)
        for k, side in enumerate(SIDES):
            self._joints[f"rocker_{side}"].wxyz = wxyz_about_y(float(frame.rocker_angle[k]))
            self._joints[f"bogie_{side}"].wxyz = wxyz_about_y(float(frame.bogie_angle[k]))
        for k, wheel in enumerate(WHEELS):
            self._joints[wheel].wxyz = wxyz_about_y(float(frame.spin[k]))
            self._tyres[k].color = of_use(float(frame.friction_utilisation[k]))

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return bool(self._root.visible)

    @visible.setter
    def visible(self, value: bool) -> None:
        self._root.visible = value


def mirrored(point: tuple[float, float, float], side: str) -> Floats:
    """Return a point of the left side on a side."""
    x, y, z = point
    return np.array([x, y if side == "left" else -y, z])


def joined(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several meshes as one."""
    return cast(trimesh.Trimesh, trimesh.util.concatenate(parts))


def beam(start: Floats, end: Floats, thick: float) -> trimesh.Trimesh:
    """Return a round bar between two points [m]; a ball where they are the same."""
    if np.linalg.norm(end - start) < 1e-6:
        return trimesh.creation.icosphere(1, thick)
    return trimesh.creation.cylinder(radius=thick, segment=[start, end], sections=10)


def body_mesh(rover: Rover) -> trimesh.Trimesh:
    """Return a box over the underside of the body, up to a wheel radius above the pivots."""
    belly = rover.belly
    low = np.array([belly.x[0], belly.y[0], belly.z])
    high = np.array([belly.x[1], belly.y[1], belly.z + 1.4 * rover.wheel.radius])
    box = trimesh.creation.box(high - low)
    box.apply_translation(0.5 * (low + high))
    pivot = rover.suspension.rocker_pivot
    axle = beam(mirrored(pivot, "right"), mirrored(pivot, "left"), 0.12 * rover.wheel.radius)
    return joined([box, axle])


def wheel_meshes(rover: Rover) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Return tyre and grousers of a wheel about its centre, axis along y."""
    radius, width = rover.wheel.radius, rover.wheel.width
    across = [[0.0, -0.5 * width, 0.0], [0.0, 0.5 * width, 0.0]]
    tyre = trimesh.creation.cylinder(radius=0.96 * radius, segment=across, sections=32)
    bars = []
    for k in range(GROUSERS):
        bar = trimesh.creation.box([0.06 * radius, 1.01 * width, 0.5 * radius])
        bar.apply_translation([0.0, 0.0, 0.75 * radius])
        turn = trimesh.transformations.rotation_matrix(2 * np.pi * k / GROUSERS, [0, 1, 0])
        bar.apply_transform(turn)
        bars.append(bar)
    return tyre, joined(bars)


def arm_mesh(arm: Manipulator, angles: Mapping[str, float], radius: float) -> trimesh.Trimesh:
    """Return the links of the arm in the body frame."""
    given = [angles.get(name, at) for name, at in zip(arm.joints, arm.stowed, strict=True)]
    points = link_points(arm, np.array(given))
    links = [beam(a, b, 0.12 * radius) for a, b in itertools.pairwise(points)]
    tip = trimesh.creation.icosphere(1, 0.25 * radius)
    tip.apply_translation(points[-1])
    return joined([*links, tip])


def outline_mesh(rover: Rover) -> trimesh.Trimesh:
    """Return body and wheels on flat ground as one mesh, for poses that are only pointed at."""
    parts = [body_mesh(rover)]
    for place in rover.suspension.wheels.values():
        for side in SIDES:
            tyre, _ = wheel_meshes(rover)
            tyre.apply_translation(mirrored(place, side))
            parts.append(tyre)
    return joined(parts)
