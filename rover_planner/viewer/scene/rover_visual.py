# SPDX-License-Identifier: Apache-2.0
"""The articulated rover in the scene, built from the numbers of its rover file."""

import itertools
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import trimesh

from rover_physics.names import SIDES, WHEEL_POSITIONS, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import wxyz_about_y, wxyz_from_rpy
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator, Rover
from rover_planner.viewer.scene.local_frame import LocalFrame
from rover_planner.viewer.state.colours import BODY, DARK, METAL, REFUSED, Colour, colour_use
from rover_planner.viewer.state.rover_state import RoverState

GROUSERS = 16
"""Grousers of a wheel as it is drawn."""


class RoverVisual:
    """The rover's nodes of the scene: body, rockers, bogies, wheels and arm, with their joints."""

    def __init__(
        self, scene: Any, rover: Rover, frame: LocalFrame, name: str, opacity: float | None
    ):
        """Add the nodes below a node `name`; without an opacity it is opaque."""
        self._scene, self._frame = scene, frame
        self._name, self._opacity = name, opacity
        self.root = scene.add_frame(name, show_axes=False)
        """The node of which all others are parts."""
        self._joints: dict[str, Any] = {}
        self._meshes: dict[str, Any] = {}
        """By the name of the link; that of a wheel is its tyre."""
        self._colours: dict[str, Colour] = {}
        self._failing = ""
        self._put("body", "body", make_body(rover), BODY)
        wheel = make_wheel(rover)
        for side in SIDES:
            self._put_side(rover, side, wheel)
        self.turn_arm(rover, {})

    def _put(self, link: str, path: str, mesh: trimesh.Trimesh, colour: Colour) -> None:
        """Add the mesh of a link, or give the one that is there another shape."""
        node = self._meshes.get(link)
        if node is not None:
            node.vertices, node.faces = mesh.vertices, mesh.faces
            return
        self._colours[link] = colour
        self._meshes[link] = self._scene.add_mesh_simple(
            f"{self._name}/{path}", mesh.vertices, mesh.faces, color=colour, flat_shading=True,
            opacity=self._opacity, cast_shadow=self._opacity is None,
        )  # fmt: skip

    def _put_joint(self, link: str, path: str, position: Floats) -> None:
        self._joints[link] = self._scene.add_frame(
            f"{self._name}/{path}", show_axes=False, position=position
        )

    def _put_side(
        self, rover: Rover, side: str, wheel: tuple[trimesh.Trimesh, trimesh.Trimesh]
    ) -> None:
        """Put rocker, bogie and wheels of a side; `wheel` is as `make_wheel` returns it."""
        suspension = rover.suspension
        rocker = on_side(suspension.rocker_pivot, side)
        bogie = on_side(suspension.bogie_pivot, side)
        wheels = {name: on_side(suspension.wheels[name], side) for name in WHEEL_POSITIONS}
        rocker_path, bogie_path = f"rocker_{side}", f"rocker_{side}/bogie"
        self._put_joint(f"rocker_{side}", rocker_path, rocker)
        self._put_joint(f"bogie_{side}", bogie_path, bogie - rocker)
        radius = 0.16 * rover.wheel.radius
        ends = [bogie - rocker, wheels[suspension.rocker_wheel] - rocker]
        self._put(f"rocker_{side}", f"{rocker_path}/beams", make_beams(ends, radius), METAL)
        ends = [wheels[name] - bogie for name in suspension.bogie_wheels]
        self._put(f"bogie_{side}", f"{bogie_path}/beams", make_beams(ends, radius), METAL)
        for position, centre in wheels.items():
            on_bogie, name = position in suspension.bogie_wheels, f"{position}_{side}"
            path = f"{bogie_path if on_bogie else rocker_path}/{position}"
            self._put_joint(name, path, centre - (bogie if on_bogie else rocker))
            self._put(name, f"{path}/tyre", wheel[0], METAL)
            self._put(f"{name} grousers", f"{path}/grousers", wheel[1], DARK)

    def turn_arm(self, rover: Rover, angles: Mapping[str, float]) -> None:
        """Show the arm at angles [rad] by joint name; joints without an angle are stowed."""
        if rover.manipulator is not None:
            arm = make_arm(rover.manipulator, angles, rover.wheel.radius)
            self._put("arm", "arm", arm, DARK)

    def show(self, state: RoverState, failing: str = "") -> None:
        """Bring the joints and the colours of the wheels to a state.

        Args:
            state: The state.
            failing: A link that fails there and has the colour of that: a name of WHEELS, body,
                or rocker or bogie with its side, such as bogie_left; empty for none.
        """
        self.root.position = self._frame.to_scene(state.position)
        self.root.wxyz = wxyz_from_rpy(*state.attitude)
        for k, side in enumerate(SIDES):
            self._joints[f"rocker_{side}"].wxyz = wxyz_about_y(float(state.rocker_angle[k]))
            self._joints[f"bogie_{side}"].wxyz = wxyz_about_y(float(state.bogie_angle[k]))
        uses = state.friction_use
        for k, wheel in enumerate(WHEELS):
            turn = 0.0, float(state.spin[k]), float(state.steering_angle[k])
            self._joints[wheel].wxyz = wxyz_from_rpy(*turn)
            self._meshes[wheel].color = colour_use(float(uses[k]))
        for link in {self._failing, failing} - {""}:
            colour = self._colours[link] if link not in WHEELS else self._meshes[link].color
            self._meshes[link].color = REFUSED if link == failing else colour
            self._meshes[link].opacity = self._opacity if link != failing else 1.0
        self._failing = failing


def on_side(point: tuple[float, float, float], side: str) -> Floats:
    """Return a point (3,) [m] of the left side as it is on a side, "left" or "right"."""
    x, y, z = point
    return np.array([x, y if side == "left" else -y, z])


def join_meshes(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return one mesh of several."""
    return cast(trimesh.Trimesh, trimesh.util.concatenate(parts))


def make_bar(start: Floats, end: Floats, radius: float) -> trimesh.Trimesh:
    """Return a round bar of a radius between two points (3,) [m]; a ball if they coincide."""
    if np.linalg.norm(end - start) < 1e-6:
        return trimesh.creation.icosphere(1, radius)
    return trimesh.creation.cylinder(radius=radius, segment=[start, end], sections=10)


def make_beams(ends: list[Floats], radius: float) -> trimesh.Trimesh:
    """Return bars of a radius from the origin to ends (3,) [m]."""
    return join_meshes([make_bar(np.zeros(3), end, radius) for end in ends])


def make_body(rover: Rover) -> trimesh.Trimesh:
    """Return a box on the belly rectangle, 1.4 wheel radii high, and the axle of the rockers."""
    belly, pivot, radius = rover.belly, rover.suspension.rocker_pivot, rover.wheel.radius
    low = np.array([belly.x[0], belly.y[0], belly.z])
    high = np.array([belly.x[1], belly.y[1], belly.z + 1.4 * radius])
    box = trimesh.creation.box(high - low)
    box.apply_translation(0.5 * (low + high))
    axle = make_bar(on_side(pivot, "right"), on_side(pivot, "left"), 0.12 * radius)
    return join_meshes([box, axle])


def make_wheel(rover: Rover) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Return tyre and grousers of a wheel about its centre, with its axis along y."""
    radius, width = rover.wheel.radius, rover.wheel.width
    across = [[0.0, -0.5 * width, 0.0], [0.0, 0.5 * width, 0.0]]
    tyre = trimesh.creation.cylinder(radius=0.96 * radius, segment=across, sections=32)
    grousers = []
    for k in range(GROUSERS):
        grouser = trimesh.creation.box([0.06 * radius, 1.01 * width, 0.5 * radius])
        grouser.apply_translation([0.0, 0.0, 0.75 * radius])
        turn = trimesh.transformations.rotation_matrix(2 * np.pi * k / GROUSERS, [0, 1, 0])
        grouser.apply_transform(turn)
        grousers.append(grouser)
    return tyre, join_meshes(grousers)


def make_arm(
    arm: Manipulator, angles: Mapping[str, float], wheel_radius: float
) -> trimesh.Trimesh:
    """Return the arm at angles [rad] by joint name, body frame; the wheel radius sets its width.

    Joints without an angle are stowed.
    """
    joint_angles = [angles.get(name, at) for name, at in zip(arm.joints, arm.stowed, strict=True)]
    points = link_points(arm, np.array(joint_angles))
    links = [make_bar(a, b, 0.12 * wheel_radius) for a, b in itertools.pairwise(points)]
    tip = trimesh.creation.icosphere(1, 0.25 * wheel_radius)
    tip.apply_translation(points[-1])
    return join_meshes([*links, tip])
