# SPDX-License-Identifier: Apache-2.0
"""A rover in the scene with the forces on its wheels."""

import itertools
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import trimesh

from rover_physics.names import SIDES, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import wxyz_about_y, wxyz_from_rpy
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Manipulator, Rover
from rover_planner.viewer.scene.canvas import Canvas
from rover_planner.viewer.state import colours
from rover_planner.viewer.state.drive import RoverState
from rover_planner.viewer.state.path_limits import BODY

WEIGHT_LENGTH = 4.0
"""Length of the arrow of a sixth of the rover's weight [wheel radii]."""
GROUSERS = 16
"""Grousers of a wheel as it is drawn."""
LEFT, RIGHT = np.array([1.0, 1.0, 1.0]), np.array([1.0, -1.0, 1.0])
"""Factors on a point of the left side [m] as it is on a side."""


class DrawnRover:
    """Body, rockers, bogies, wheels, arm and forces of a rover, which stay for the next one.

    The node of a link is its mesh, below that of the link it hangs on.
    """

    def __init__(self, canvas: Canvas, name: str, opacity: float | None = None):
        """Draw nothing yet; nodes will be below a node `name`, opaque without an opacity."""
        self._canvas, self._name, self._opacity = canvas, name, opacity
        self.forces = f"{name}/forces"
        """The node of its arrows."""
        self.rover: Rover | None = None
        """The rover; None before the first."""
        self.state: RoverState | None = None
        """The state that is shown; None hides the rover."""
        self._looks: tuple[Any, ...] = ()
        """Values that the shape of the rover and the length of its arrows depend on."""
        self._arm: dict[str, float] = {}
        self.meshes: dict[str, tuple[str, colours.Colour]] = {}
        """Node and colour of each link by its name; that of a wheel is its tyre."""

    def take(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        """Draw another rover, with its arm at angles [rad] by joint name.

        Of a rover that looks like the last one, only the arm is turned.
        """
        wheel, arm = rover.wheel, rover.manipulator
        self._canvas.radius = wheel.radius
        looks = wheel.radius, wheel.width, rover.suspension, rover.belly, arm, rover.weight
        is_new = looks != self._looks
        if is_new:
            self._looks, self.rover, self.meshes = (), None, {}  # no half a rover after an error
            self._canvas.show_frame(self._name, visible=self.state is not None)
            self._canvas.show_frame(self.forces)
            self._put(BODY, "", np.zeros(3), make_body(rover), colours.BODY)
            tyre, grousers = make_wheel(rover)
            for side in SIDES:
                self._put_side(rover, side, tyre, grousers)
            kept = [node for node, _ in self.meshes.values()]
            self._canvas.remove(f"{self._name}/{BODY}", kept)
        if arm is not None and (is_new or arm_angles != self._arm):
            mesh = make_arm(arm, arm_angles, wheel.radius)
            self._put("arm", BODY, np.zeros(3), mesh, colours.DARK)
        self._looks, self._arm, self.rover = looks, dict(arm_angles), rover
        if is_new:
            self.show(self.state)

    def _put(
        self, link: str, above: str, place: Floats, mesh: trimesh.Trimesh, colour: colours.Colour
    ) -> None:
        """Put the mesh of a link at a place (3,) [m] of the link above; the first has none."""
        parent = self.meshes[above][0] if above else self._name
        name, opacity = f"{parent}/{link}", self._opacity
        self.meshes[link] = name, colour
        self._canvas.show(
            self._canvas.scene.add_mesh_simple, name, vertices=mesh.vertices, faces=mesh.faces,
            position=place, color=colour, flat_shading=True, opacity=opacity,
            cast_shadow=opacity is None,
        )  # fmt: skip

    def _put_side(
        self, rover: Rover, side: str, tyre: trimesh.Trimesh, grousers: trimesh.Trimesh
    ) -> None:
        """Put rocker, bogie and wheels of a side."""
        suspension, mirror = rover.suspension, LEFT if side == "left" else RIGHT
        rocker, bogie = f"rocker_{side}", f"bogie_{side}"
        carriers = {suspension.rocker_wheel: rocker}
        carriers |= dict.fromkeys(suspension.bogie_wheels, bogie)
        pivots = {rocker: mirror * suspension.rocker_pivot, bogie: mirror * suspension.bogie_pivot}
        wheels = {name: mirror * suspension.wheels[name] for name in carriers}
        places = {rocker: pivots[rocker], bogie: pivots[bogie] - pivots[rocker]}
        for link, above in ((rocker, BODY), (bogie, rocker)):
            ends = [wheels[name] for name, on in carriers.items() if on == link]
            ends += [pivots[bogie]] if link == rocker else []
            width = 0.16 * rover.wheel.radius
            beams = [make_bar(np.zeros(3), end - pivots[link], width) for end in ends]
            self._put(link, above, places[link], join_meshes(beams), colours.METAL)
        for position, on in carriers.items():
            name = f"{position}_{side}"
            self._put(name, on, wheels[position] - pivots[on], tyre, colours.METAL)
            self._put(f"{name}_grousers", name, np.zeros(3), grousers, colours.DARK)

    def show(self, state: RoverState | None, failing: str = "") -> None:
        """Show rover and forces in a state.

        Args:
            state: The state; None hides the rover.
            failing: A link that fails there and has the colour of that: a name of WHEELS, body,
                or rocker or bogie with its side, such as bogie_left; empty for none.
        """
        self.state = state
        if self.rover is None:
            return
        self._canvas.show_frame(self._name, visible=state is not None)
        if state is not None:
            self._show_links(state, failing)
            self._draw_forces(state, self.rover)

    def _show_links(self, state: RoverState, failing: str) -> None:
        """Bring the links to a state; wheels have the colours of their use of friction."""
        rolled = wxyz_from_rpy(np.zeros(6), state.spin, state.steering_angle)
        turns = {BODY: wxyz_from_rpy(*state.attitude), **dict(zip(WHEELS, rolled, strict=True))}
        for k, side in enumerate(SIDES):
            turns[f"rocker_{side}"] = wxyz_about_y(float(state.rocker_angle[k]))
            turns[f"bogie_{side}"] = wxyz_about_y(float(state.bogie_angle[k]))
        used = dict(zip(WHEELS, map(colours.colour_use, state.friction_use), strict=True))
        for link, turn in turns.items():
            (node, own), fails = self.meshes[link], link == failing
            colour = colours.REFUSED if fails else used.get(link, own)
            opacity = 1.0 if fails else self._opacity
            self._canvas.change(node, color=colour, opacity=opacity, wxyz=turn)
        self._canvas.change(self.meshes[BODY][0], position=self._canvas.to_scene(state.position))

    def _draw_forces(self, state: RoverState, rover: Rover) -> None:
        """Draw the normal forces and those along the ground, of no length if not known."""
        axis, outwards = state.axles, state.wheel_centres - state.contact_points
        normal = outwards - (outwards * axis).sum(axis=1, keepdims=True) * axis
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        along, radius = np.cross(axis, normal), rover.wheel.radius
        points = self._canvas.to_scene(state.contact_points)
        N, T, S = (
            WEIGHT_LENGTH * radius / (rover.weight / 6.0) * np.nan_to_num(values)[:, None]
            for values in (state.wheel_loads, state.tangential, state.lateral)
        )
        arrows = {
            "normal": (points + N * normal, colours.LOAD),
            "along": (points + (T * along + S * axis), colours.TRACTION),
        }
        for name, (tips, colour) in arrows.items():
            self._canvas.show(
                self._canvas.scene.add_arrows, f"{self.forces}/{name}",
                points=np.stack([points, tips], axis=1), colors=np.array(colour, np.uint8),
                shaft_radius=0.07 * radius, head_radius=0.16 * radius, head_length=0.35 * radius,
            )  # fmt: skip


def join_meshes(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return one mesh of several."""
    return cast(trimesh.Trimesh, trimesh.util.concatenate(parts))


def make_bar(start: Floats, end: Floats, radius: float) -> trimesh.Trimesh:
    """Return a round bar of a radius between two points (3,) [m]; a ball if they coincide."""
    if np.linalg.norm(end - start) < 1e-6:
        return trimesh.creation.icosphere(1, radius)
    return trimesh.creation.cylinder(radius=radius, segment=[start, end], sections=10)


def make_body(rover: Rover) -> trimesh.Trimesh:
    """Return a box on the belly rectangle, 1.4 wheel radii high, and the axle of the rockers."""
    belly, pivot, radius = rover.belly, rover.suspension.rocker_pivot, rover.wheel.radius
    low = np.array([belly.x[0], belly.y[0], belly.z])
    high = np.array([belly.x[1], belly.y[1], belly.z + 1.4 * radius])
    axle = make_bar(RIGHT * pivot, LEFT * pivot, 0.12 * radius)
    return join_meshes([trimesh.creation.box(bounds=[low, high]), axle])


def make_wheel(rover: Rover) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Return tyre and grousers of a wheel about its centre, with its axis along y."""
    radius, width = rover.wheel.radius, rover.wheel.width
    across = [[0.0, -0.5 * width, 0.0], [0.0, 0.5 * width, 0.0]]
    tyre = trimesh.creation.cylinder(radius=0.96 * radius, segment=across, sections=32)
    half = np.array([0.03 * radius, 0.505 * width, 0.25 * radius])
    bounds = np.array([-half, half]) + np.array([0.0, 0.0, 0.75 * radius])
    turns = [
        trimesh.transformations.rotation_matrix(angle, [0, 1, 0])
        for angle in np.linspace(0.0, 2.0 * np.pi, GROUSERS, endpoint=False)
    ]
    grousers = [trimesh.creation.box(bounds=bounds).apply_transform(turn) for turn in turns]
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
